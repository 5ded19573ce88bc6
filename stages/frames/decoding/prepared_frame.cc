#include "stages/frames/decoding/prepared_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "manifests/values/outlines.h"
#include "manifests/values/still_motion.h"
#include "stages/frames/decoding/detail/scaled_layers.h"
#include "stages/frames/decoding/detail/still_layers.h"
#include "stages/frames/decoding/detail/unless_refused.h"
#include "stages/frames/decoding/still_clip.h"

namespace eventgan {

VisiblePart visible_part(const Placement& placement) {
  VisiblePart part;
  part.scaled_x = std::max(0, -placement.offset_x);
  part.scaled_y = std::max(0, -placement.offset_y);
  part.volume_x = std::max(0, placement.offset_x);
  part.volume_y = std::max(0, placement.offset_y);
  part.size.height =
      std::min(placement.scaled.height - part.scaled_y, placement.volume.height - part.volume_y);
  part.size.width =
      std::min(placement.scaled.width - part.scaled_x, placement.volume.width - part.volume_x);
  return part;
}

namespace {

using Channels = ImageView::Channels;

cv::Mat as_grey(const cv::Mat& image, Channels channels) {
  if (channels == Channels::kGrey) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, channels == Channels::kBgr ? cv::COLOR_BGR2GRAY : cv::COLOR_RGB2GRAY);
  return grey;
}

cv::Mat matrix_of(const ImageView& image) {
  return {image.size.height, image.size.width,
          image.channels == Channels::kGrey ? CV_8UC1 : CV_8UC3,
          const_cast<std::uint8_t*>(image.pixels)};
}

/// What is resized: of the image what `placement` leaves of it.
cv::Mat without_borders(const cv::Mat& image, const Placement& placement) {
  const ImageSize cut = placement.cut();
  return image(cv::Rect(placement.border_x, placement.border_y, cut.width, cut.height));
}

/// An image of these channels as it is to be resized.
struct Resizable {
  cv::Mat image;
  Channels channels;
};

Resizable grey_if_first(const ImageView& frame, const ImageSpec& spec) {
  const cv::Mat image = matrix_of(frame);
  if (spec.grey == GreyOrder::kAfterResize) return {image, frame.channels};
  return {as_grey(image, frame.channels), Channels::kGrey};
}

/// Resized and grey, uncut.
cv::Mat scaled_grey(const Resizable& whole, const Placement& placement) {
  const cv::Size scaled(placement.scaled.width, placement.scaled.height);
  cv::Mat resized = without_borders(whole.image, placement);
  if (resized.size() != scaled) {  // else OpenCV would make a copy
    cv::Mat other;
    cv::resize(resized, other, scaled, 0, 0, cv::INTER_LINEAR);
    resized = other;
  }
  return as_grey(resized, whole.channels);
}

/// How far the map moves a corner at most: of an affine one no point between them moves farther.
double farthest(const AffineMap& map, const Rectangle& around) {
  double most = 0;
  for (const Point corner : {Point{around.left, around.top},
                             {around.right, around.top},
                             {around.left, around.bottom},
                             {around.right, around.bottom}}) {
    const Point moved = mapped(map, corner);
    most = std::max(most, std::hypot(moved.x - corner.x, moved.y - corner.y));
  }
  return most;
}

// How far an object goes on behind another beyond its outline, in a frame that nobody labels.
constexpr double kFarthestBehind_px = 40;

/// A still that moves from the previous frame of its pair to the next.
class MovingStill {
 public:
  /// The image is shared.
  MovingStill(const Resizable& still, const FramePair& pair, const std::vector<Box>& boxes)
      : size_{still.image.rows, still.image.cols},
        image_(still.image),
        pair_(pair),
        boxes_(boxes),
        layers_(image_, objects(), kFarthestBehind_px) {}

  /// The frame at u, 0 previous to 1 next; it may be the image itself. Thread safe.
  cv::Mat at(double u) const {
    if (u == pair_.label_position) return image_;
    return layers_.frame(image_map(u), object_maps(u));
  }

  /// For `frame`, while this lives.
  ScaledLayers scaled(const Placement& placement, Channels channels) const {
    cv::Mat resting;
    if (pair_.motion == ImageMotion()) {
      const cv::Mat frame = layers_.resting_frame(object_maps(moved_end()));
      resting = scaled_grey({frame, channels}, placement);
    }
    return {layers_, placement, resting};
  }

  /// As `at`, but resized and grey (ScaledLayers).
  cv::Mat frame(const ScaledLayers& scaled, double u) const {
    return scaled.frame(image_map(u), object_maps(u));
  }

  double moved_end() const { return 1 - pair_.label_position; }

  /// StillLayers::seen of that frame.
  cv::Mat seen(double u) const { return layers_.seen(object_maps(u)); }

  /// Where what lies at a point of the labelled image lies in the moved frame, if it is what `seen`
  /// calls `number`.
  AffineMap step(std::size_t number) const {
    return inverse(number == 0 ? image_map(moved_end()) : object_map(number - 1, moved_end()));
  }

  /// No point of the image or of an object moves farther than that, pixels of the image.
  double displacement_px() const {
    const double right = size_.width - 0.5, bottom = size_.height - 0.5;
    double most = farthest(image_map(moved_end()), {-0.5, -0.5, right, bottom});
    for (std::size_t k = 0; k < pair_.objects.size(); ++k) {
      if (!pair_.objects[k] || k >= boxes_.size() || boxes_[k].outline.empty()) continue;
      const Rectangle seen = seen_of(bounds(boxes_[k].outline));
      most = std::max(most, farthest(object_map(k, moved_end()), seen));
    }
    return most;
  }

 private:
  AffineMap image_map(double u) const {
    return u == moved_end() ? moved_to_labelled(size_, pair_) : image_to_labelled(size_, pair_, u);
  }

  /// An object that rests moves exactly as the image does.
  AffineMap object_map(std::size_t k, double u) const {
    const ImageMotion& motion = *pair_.objects[k];
    return motion == ImageMotion() ? image_map(u)
                                   : object_to_labelled(size_, pair_, motion, boxes_.at(k), u);
  }

  /// Of the boxes that have a motion; the others' are not looked at.
  std::vector<AffineMap> object_maps(double u) const {
    std::vector<AffineMap> maps(pair_.objects.size());
    for (std::size_t k = 0; k < maps.size(); ++k) {
      if (pair_.objects[k]) maps[k] = object_map(k, u);
    }
    return maps;
  }

  /// What the image holds of it, as points: an edge lies half a pixel before the centre of the
  /// pixel with its number.
  Rectangle seen_of(const Rectangle& edges) const {
    const auto within = [](double edge, int end) {
      return std::clamp(edge, 0.0, double(end)) - 0.5;
    };
    return {within(edges.left, size_.width), within(edges.top, size_.height),
            within(edges.right, size_.width), within(edges.bottom, size_.height)};
  }

  /// What moves on its own, and what may hide it. The one place that asks for outlines.
  std::vector<StillObject> objects() const {
    std::vector<StillObject> objects;
    for (std::size_t k = 0; k < std::min(pair_.objects.size(), boxes_.size()); ++k) {
      if (!pair_.objects[k] || boxes_[k].outline.empty()) continue;
      double reach_px = 0;
      if (*pair_.objects[k] != ImageMotion()) {
        for (const double u : {0.0, 0.5, 1.0}) {  // over the background, from where it lies in it
          const AffineMap over = compose(image_map(u), inverse(object_map(k, u)));
          reach_px = std::max(reach_px, farthest(over, bounds(boxes_[k].outline)));
        }
      }
      objects.push_back({k, boxes_[k].outline, boxes_[k].xyxy.bottom, reach_px});
    }
    return objects;
  }

  ImageSize size_;
  cv::Mat image_;
  FramePair pair_;
  std::vector<Box> boxes_;
  StillLayers layers_;
};

/// Two frames of a clip that is made of a still, and what is between them.
class ClipFrames {
 public:
  ClipFrames(const Resizable& still, const FramePair& pair, const std::vector<Box>& boxes)
      : from_(pair.poses.at(0)),
        to_(pair.poses.at(1)),
        label_position_(pair.label_position),
        type_(still.image.type()),
        clip_({{still.image.rows, still.image.cols}, still.image.data, still.channels}, boxes,
              from_) {}

  /// The frame at u, 0 previous to 1 next. Thread safe.
  cv::Mat at(double u) const {
    std::vector<std::uint8_t> pixels = clip_.frame(pose_between(from_, to_, u));
    return cv::Mat(clip_.size().height, clip_.size().width, type_, pixels.data()).clone();
  }

  double displacement_px() const { return clip_.displacement_px(from_, to_); }

  double moved_end() const { return 1 - label_position_; }

  /// As MovingStill's, of either end.
  cv::Mat seen(double u) const {
    std::vector<std::uint16_t> pixels = clip_.seen(u == 0 ? from_ : to_);
    if (pixels.empty()) return {};
    return cv::Mat(clip_.size().height, clip_.size().width, CV_16UC1, pixels.data()).clone();
  }

  AffineMap step(std::size_t number) const {
    return label_position_ == 0 ? clip_.step(from_, to_, number) : clip_.step(to_, from_, number);
  }

 private:
  StillPose from_, to_;
  double label_position_;
  int type_;
  StillClip clip_;
};

/// What the volume shows of a resized grey frame, blurred.
std::vector<std::uint8_t> finished(cv::Mat grey, const Placement& placement,
                                   const ImageSpec& spec) {
  if (spec.blur != 0) {
    cv::Mat blurred;
    cv::GaussianBlur(grey, blurred, cv::Size(spec.blur, spec.blur), 0);
    grey = blurred;
  }
  const VisiblePart part = visible_part(placement);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(part.size.pixel_count());
  for (int y = 0; y < part.size.height; ++y) {
    const std::uint8_t* row = grey.ptr<std::uint8_t>(part.scaled_y + y) + part.scaled_x;
    pixels.insert(pixels.end(), row, row + part.size.width);
  }
  return pixels;
}

/// `Moving`: MovingStill or ClipFrames.
template <class Moving>
PixelFlow flow_of(const Moving& moving, const Placement& placement) {
  constexpr double kSteps = 128;  // to a pixel, as in DSEC's files; they compress well, too
  // By way of integers, several times as fast as round().
  const auto stepped = [](double px) {
    return static_cast<double>(std::int64_t(px * kSteps + (px < 0 ? -0.5 : 0.5))) / kSteps;
  };
  const VisiblePart part = visible_part(placement);
  const AffineMap to_volume = placement.source_to_volume(), to_source = inverse(to_volume);
  const double moved_end = moving.moved_end();
  const cv::Mat here = moving.seen(1 - moved_end), there = moving.seen(moved_end);
  const auto shown = [&](const cv::Mat& seen, Point at) -> std::size_t {
    if (seen.empty()) return 0;
    const Point source = mapped(to_source, at);
    const auto nearest = [](double place, int count) {
      return static_cast<int>(std::clamp(place, 0.0, count - 1.0) + 0.5);
    };
    return seen.at<std::uint16_t>(nearest(source.y, seen.rows), nearest(source.x, seen.cols));
  };
  std::vector<std::optional<AffineMap>> steps;  // from the labelled frame, in the volume
  const auto step_of = [&](std::size_t number) {
    if (steps.size() <= number) steps.resize(number + 1);
    auto& step = steps[number];
    if (!step) step = compose(compose(to_volume, moving.step(number)), to_source);
    return *step;
  };
  const std::size_t pixels = placement.volume.pixel_count();
  PixelFlow flow{std::vector<float>(2 * pixels), std::vector<std::uint8_t>(pixels)};
  const int right = part.volume_x + part.size.width, bottom = part.volume_y + part.size.height;
  const double sign = moved_end == 1 ? 1 : -1;  // of time
  std::size_t last = 0;
  AffineMap step = step_of(last);
  for (int y = part.volume_y; y < bottom; ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * placement.volume.width;
    for (int x = part.volume_x; x < right; ++x) {
      const Point at{double(x), double(y)};
      const std::size_t number = shown(here, at);
      if (number != last) step = step_of(last = number);
      const Point moved = mapped(step, at);
      const double dx = stepped(moved.x - x), dy = stepped(moved.y - y);
      const Point target{x + dx, y + dy};
      const bool is_inside = target.x >= part.volume_x && target.x <= right - 1 &&
                             target.y >= part.volume_y && target.y <= bottom - 1;
      const std::size_t pixel = row + static_cast<std::size_t>(x);
      flow.px[pixel] = static_cast<float>(sign * dx + 0.0);  // no -0
      flow.px[pixels + pixel] = static_cast<float>(sign * dy + 0.0);
      flow.valid[pixel] = is_inside && shown(there, target) == number;
    }
  }
  return flow;
}

constexpr auto kInputOfGrey = [] {
  std::array<float, 256> table{};
  for (int level = 0; level < 256; ++level) {
    table[level] = (static_cast<float>(level) / 255.0f - 0.5f) * 2.0f;
  }
  return table;
}();

PreparedFrame prepare(const Resizable& image, const Placement& placement, const ImageSpec& spec) {
  return {finished(scaled_grey(image, placement), placement, spec), placement};
}

}  // namespace

PreparedFrame prepare_frame(const ImageView& frame, const ImageSpec& spec) {
  return unless_refused([&] {
    const Placement placement = place(frame.size, spec);
    return prepare(grey_if_first(frame, spec), placement, spec);
  });
}

std::array<PreparedFrame, 2> prepare_still(const ColourView& image, const FramePair& pair,
                                           const ImageSpec& spec, const std::vector<Box>& boxes,
                                           PixelFlow* flow) {
  return unless_refused([&] {
    const Resizable still = grey_if_first(image, spec);
    if (!pair.poses.empty()) {
      const Placement placement = place(clip_window(image.size).size, spec);
      const ClipFrames clip(still, pair, boxes);
      if (flow) *flow = flow_of(clip, placement);
      return std::array{prepare({clip.at(0), still.channels}, placement, spec),
                        prepare({clip.at(1), still.channels}, placement, spec)};
    }
    const Placement placement = place(image.size, spec, pair);
    const MovingStill moving(still, pair, boxes);
    if (flow) *flow = flow_of(moving, placement);
    std::array<PreparedFrame, 2> frames = {
        prepare({moving.at(moving.moved_end()), still.channels}, placement, spec),
        prepare(still, placement, spec)};
    if (pair.label_position == 0) std::swap(frames[0], frames[1]);
    return frames;
  });
}

ColourFrame move_still(const ColourFrame& image, const FramePair& pair,
                       const std::vector<Box>& boxes) {
  return unless_refused([&] {
    const MovingStill moving({matrix_of({image.size, image.bgr.data()}), Channels::kBgr}, pair,
                             boxes);
    const cv::Mat result = moving.at(moving.moved_end());
    return ColourFrame{image.size, {result.datastart, result.dataend}};
  });
}

namespace {

/// `Moving`: MovingStill or ClipFrames, of an image that lives as long.
template <class Moving>
struct KeptImage {
  SharedImage image;
  Resizable still;
  Moving moving;

  KeptImage(SharedImage frame, const FramePair& pair, const ImageSpec& spec,
            const std::vector<Box>& boxes)
      : image(std::move(frame)),
        still(grey_if_first({image->size, image->bgr.data()}, spec)),
        moving(still, pair, boxes) {}
};

template <class Moving>
FramesBetween between_of(const std::shared_ptr<const KeptImage<Moving>>& kept,
                         const ImageSpec& spec, const Placement& placement, PixelFlow* flow) {
  if (flow) *flow = flow_of(kept->moving, placement);
  return {[kept, spec, placement](double u) {
            return unless_refused([&] {
              PreparedFrame frame =
                  prepare({kept->moving.at(u), kept->still.channels}, placement, spec);
              return GreyImage{visible_part(placement).size, std::move(frame.grey)};
            });
          },
          kept->moving.displacement_px() * std::max(placement.scale_x(), placement.scale_y())};
}

}  // namespace

FramesBetween frames_between(const SharedImage& image, const FramePair& pair, const ImageSpec& spec,
                             const std::vector<Box>& boxes, PixelFlow* flow) {
  return unless_refused([&] {
    if (!pair.poses.empty()) {
      const Placement placement = place(clip_window(image->size).size, spec);
      return between_of(std::make_shared<const KeptImage<ClipFrames>>(image, pair, spec, boxes),
                        spec, placement, flow);
    }
    const Placement placement = place(image->size, spec, pair);
    const auto kept = std::make_shared<const KeptImage<MovingStill>>(image, pair, spec, boxes);
    FramesBetween between = between_of(kept, spec, placement, flow);
    const auto scaled =
        std::make_shared<const ScaledLayers>(kept->moving.scaled(placement, kept->still.channels));
    between.at = [end = std::move(between.at), label = pair.label_position, kept, scaled, placement,
                  spec](double u) {
      if (u == label) return end(u);
      return unless_refused([&] {
        return GreyImage{visible_part(placement).size,
                         finished(kept->moving.frame(*scaled, u), placement, spec)};
      });
    };
    return between;
  });
}

void to_input(std::span<const std::uint8_t> grey, std::span<float> input) {
  std::ranges::transform(grey, input.begin(),
                         [](std::uint8_t level) { return kInputOfGrey[level]; });
}

PreparedPair prepare_pair(const PreparedFrame& previous, const PreparedFrame& next) {
  PreparedPair prepared;
  prepared.placement = previous.placement;
  const VisiblePart part = visible_part(prepared.placement);
  prepared.content = part.size;
  prepared.content_x = part.volume_x;
  prepared.content_y = part.volume_y;
  // By way of a block in the first-level cache: a vector that is made longer is filled with zeros.
  std::array<float, 4096> block;
  prepared.input.reserve(2 * part.size.pixel_count());
  for (std::span<const std::uint8_t> grey : {std::span(previous.grey), std::span(next.grey)}) {
    while (!grey.empty()) {
      const std::size_t count = std::min(grey.size(), block.size());
      to_input(grey.first(count), block);
      prepared.input.insert(prepared.input.end(), block.begin(), block.begin() + count);
      grey = grey.subspan(count);
    }
  }
  return prepared;
}

std::vector<std::uint8_t> place_colour(const ColourFrame& frame, const Placement& placement) {
  if (frame.size != placement.source) {
    throw std::invalid_argument("expected a frame of the placement's source size, got another");
  }
  const ImageSize volume = placement.volume;
  std::vector<std::uint8_t> placed(3 * volume.pixel_count(), 0);
  const cv::Mat source = matrix_of({frame.size, frame.bgr.data()});
  cv::Mat scaled;
  cv::resize(without_borders(source, placement), scaled,
             cv::Size(placement.scaled.width, placement.scaled.height), 0, 0, cv::INTER_LINEAR);

  const VisiblePart part = visible_part(placement);
  const cv::Size size(part.size.width, part.size.height);
  cv::Mat canvas(volume.height, volume.width, CV_8UC3, placed.data());
  scaled(cv::Rect(cv::Point(part.scaled_x, part.scaled_y), size))
      .copyTo(canvas(cv::Rect(cv::Point(part.volume_x, part.volume_y), size)));
  return placed;
}

}  // namespace eventgan
