#include "stages/frames/decoding/still_clip.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <utility>

#include "manifests/values/outlines.h"
#include "manifests/values/still_motion.h"
#include "stages/frames/decoding/detail/frame_steps.h"
#include "stages/frames/decoding/detail/scaled_layers.h"
#include "stages/frames/decoding/detail/still_layers.h"
#include "stages/frames/decoding/detail/unless_refused.h"

namespace eventgan {
namespace {

// A frame with labels of its own shows no more of an object behind another than these have.
constexpr double kFarthestBehind_px = 0;

bool is_object(const Box& box, const StillPose& pose, std::size_t k) {
  return k < pose.objects.size() && pose.objects[k].has_value() && !box.outline.empty();
}

/// All that hides anything may move any distance within a clip, and what it hides is the same in
/// all of its frames.
std::vector<StillObject> objects_of(const std::vector<Box>& boxes, const StillPose& pose,
                                    ImageSize image) {
  const double far_px = image.width + image.height;
  std::vector<StillObject> objects;
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    if (!is_object(boxes[k], pose, k)) continue;
    objects.push_back({k, boxes[k].outline, boxes[k].xyxy.bottom, far_px});
  }
  return objects;
}

/// How far apart the maps lead a point of the still at most; of affine ones a corner.
double farthest_apart(const AffineMap& from, const AffineMap& to, const Rectangle& around) {
  double most = 0;
  for (const Point corner : {Point{around.left, around.top},
                             {around.right, around.top},
                             {around.left, around.bottom},
                             {around.right, around.bottom}}) {
    const Point a = mapped(from, corner), b = mapped(to, corner);
    most = std::max(most, std::hypot(b.x - a.x, b.y - a.y));
  }
  return most;
}

}  // namespace

struct StillClip::State {
  State(const ImageView& view, std::vector<Box> of_still, const StillPose& pose)
      : image(view.size),
        window(clip_window(view.size)),
        boxes(std::move(of_still)),
        objects(objects_of(boxes, pose, image)),
        layers(matrix_of(view), objects, kFarthestBehind_px) {
    std::ranges::stable_sort(objects, {}, &StillObject::lower_edge);
  }

  AffineMap object_map(const StillPose& pose, std::size_t k) const {
    return object_in_clip(image, pose, pose.objects.at(k).value(), boxes[k]);
  }

  /// For StillLayers.
  std::vector<AffineMap> maps_back(const StillPose& pose) const {
    std::vector<AffineMap> maps(boxes.size());
    for (const StillObject& object : objects) {
      maps[object.box] = inverse(object_map(pose, object.box));
    }
    return maps;
  }

  /// The window's part of what is of the image's size, row after row.
  template <class Element>
  std::vector<Element> windowed(const cv::Mat& whole) const {
    const std::size_t size = whole.elemSize() / sizeof(Element);
    std::vector<Element> pixels;
    pixels.reserve(size * window.size.pixel_count());
    for (int y = window.y; y < window.y + window.size.height; ++y) {
      const Element* row = whole.ptr<Element>(y) + size * static_cast<std::size_t>(window.x);
      pixels.insert(pixels.end(), row, row + size * static_cast<std::size_t>(window.size.width));
    }
    return pixels;
  }

  ImageSize image;
  ClipWindow window;
  std::vector<Box> boxes;
  std::vector<StillObject> objects;  ///< farther ones first
  StillLayers layers;
};

StillClip::StillClip(const ImageView& image, std::vector<Box> boxes, const StillPose& pose)
    : state_(unless_refused(
          [&] { return std::make_shared<const State>(image, std::move(boxes), pose); })) {}

ImageSize StillClip::size() const { return state_->window.size; }

std::vector<std::uint8_t> StillClip::frame(const StillPose& pose) const {
  return unless_refused([&] {
    return state_->windowed<std::uint8_t>(
        state_->layers.frame(inverse(image_in_clip(state_->image, pose)), state_->maps_back(pose)));
  });
}

std::function<GreyImage(const StillPose&)> StillClip::resized(const Placement& placement) const {
  return unless_refused([&] {
    const cv::Point window(state_->window.x, state_->window.y);
    const auto scaled = std::make_shared<const ScaledLayers>(state_->layers, placement, window);
    return [state = state_, scaled](const StillPose& pose) {
      return unless_refused([&] {
        const cv::Mat frame =
            scaled->frame(inverse(image_in_clip(state->image, pose)), state->maps_back(pose));
        return GreyImage{{frame.rows, frame.cols}, {frame.datastart, frame.dataend}};
      });
    };
  });
}

std::vector<std::uint16_t> StillClip::seen(const StillPose& pose) const {
  return unless_refused([&] {
    const cv::Mat whole = state_->layers.seen(state_->maps_back(pose));
    return whole.empty() ? std::vector<std::uint16_t>() : state_->windowed<std::uint16_t>(whole);
  });
}

AffineMap StillClip::step(const StillPose& from, const StillPose& to, std::size_t number) const {
  const auto placed = [&](const StillPose& pose) {
    const AffineMap map =
        number == 0 ? image_in_clip(state_->image, pose) : state_->object_map(pose, number - 1);
    const AffineMap into_window{1, 0, -double(state_->window.x), 0, 1, -double(state_->window.y)};
    return compose(into_window, map);
  };
  return compose(placed(to), inverse(placed(from)));
}

double StillClip::displacement_px(const StillPose& from, const StillPose& to) const {
  const ImageSize image = state_->image;
  double most = farthest_apart(image_in_clip(image, from), image_in_clip(image, to),
                               {-0.5, -0.5, image.width - 0.5, image.height - 0.5});
  for (const StillObject& object : state_->objects) {
    most =
        std::max(most, farthest_apart(state_->object_map(from, object.box),
                                      state_->object_map(to, object.box), bounds(object.outline)));
  }
  return most;
}

std::array<std::vector<float>, 2> StillClip::shifts_px(const StillPose& from,
                                                       const StillPose& to) const {
  const ClipWindow& window = state_->window;
  std::array<std::vector<float>, 2> shifts;
  for (auto& values : shifts) values.resize(window.size.pixel_count());
  const auto fill = [&](const AffineMap& at_first, const AffineMap& later, const GreyImage* mask) {
    const AffineMap map = compose(later, inverse(at_first));
    std::size_t pixel = 0;
    for (int y = window.y; y < window.y + window.size.height; ++y) {
      for (int x = window.x; x < window.x + window.size.width; ++x, ++pixel) {
        if (mask && mask->pixels[pixel] == 0) continue;
        const Point at = mapped(map, {double(x), double(y)});
        shifts[0][pixel] = static_cast<float>(at.x - x);
        shifts[1][pixel] = static_cast<float>(at.y - y);
      }
    }
  };
  fill(image_in_clip(state_->image, from), image_in_clip(state_->image, to), nullptr);
  for (const StillObject& object : state_->objects) {
    const AffineMap map = state_->object_map(from, object.box);
    Outline outline = object.outline;
    for (auto& ring : outline.rings) {
      for (Point& corner : ring) {
        corner = mapped_edge(map, corner);
        corner = {corner.x - window.x, corner.y - window.y};
      }
    }
    const GreyImage mask = mask_of(outline, window.size);
    fill(map, state_->object_map(to, object.box), &mask);
  }
  return shifts;
}

}  // namespace eventgan
