#include "stages/frames/decoding/moving_still.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "manifests/values/outlines.h"
#include "manifests/values/still_motion.h"
#include "stages/frames/decoding/detail/frame_steps.h"
#include "stages/frames/decoding/detail/scaled_layers.h"
#include "stages/frames/decoding/detail/still_layers.h"
#include "stages/frames/decoding/detail/unless_refused.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/frames/decoding/still_clip.h"

namespace eventgan {
namespace {

/// What is seen from the previous frame of a pair, u = 0, to the next, u = 1. Thread safe.
class Motion {
 public:
  virtual ~Motion() = default;

  /// The frame at u: [y, x] uint8 of the placement's scaled size, grey.
  virtual cv::Mat frame(double u) const = 0;

  /// StillLayers::seen of either end; of a clip, of what its window shows; of a reduced image, of
  /// its pixels.
  virtual cv::Mat seen(double u) const = 0;

  /// Where what lies at a point of the labelled frame lies in the other one, if it is what `seen`
  /// calls `number`.
  virtual AffineMap step(std::size_t number) const = 0;

  /// No point of the image or of an object moves farther than that, pixels of the image.
  virtual double displacement_px() const = 0;
};

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

/// From a point of an image to where it lies in the reduced one.
AffineMap reducing(int by) {
  const double scale = 1.0 / by, shift = scale / 2 - 0.5;
  return {scale, 0, shift, 0, scale, shift};
}

/// How image and objects of a still move from the one frame of its pair to the other.
class MovingLayers {
 public:
  /// `image`: of that size, or reduced; shared.
  MovingLayers(const cv::Mat& image, ImageSize size, int reduced_by, const FramePair& pair,
               const std::vector<Box>& boxes)
      : size_(size),
        reduced_by_(reduced_by),
        pair_(pair),
        boxes_(boxes),
        layers_(image, objects(), kFarthestBehind_px / reduced_by) {}

  const StillLayers& layers() const { return layers_; }
  double moved_end() const { return 1 - pair_.label_position; }
  bool image_rests() const { return pair_.motion == ImageMotion(); }

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

  // From the frame at u to the labelled image.
  AffineMap image_map(double u) const {
    return u == moved_end() ? moved_to_labelled(size_, pair_) : image_to_labelled(size_, pair_, u);
  }

  /// An object that rests moves exactly as the image does.
  AffineMap object_map(std::size_t k, double u) const {
    const ImageMotion& motion = *pair_.objects[k];
    return motion == ImageMotion() ? image_map(u)
                                   : object_to_labelled(size_, pair_, motion, boxes_.at(k), u);
  }

  // As StillLayers wants them, in pixels of the image that it has.
  AffineMap background_map(double u) const { return reduced(image_map(u)); }

  /// Of the boxes that have a motion; the others' are not looked at.
  std::vector<AffineMap> object_maps(double u) const {
    std::vector<AffineMap> maps(pair_.objects.size());
    for (std::size_t k = 0; k < maps.size(); ++k) {
      if (pair_.objects[k]) maps[k] = reduced(object_map(k, u));
    }
    return maps;
  }

 private:
  AffineMap reduced(const AffineMap& map) const {
    const AffineMap reduce = reducing(reduced_by_);
    return compose(compose(reduce, map), inverse(reduce));
  }

  Outline reduced(Outline outline) const {
    for (auto& ring : outline.rings) {
      for (Point& corner : ring) corner = {corner.x / reduced_by_, corner.y / reduced_by_};
    }
    return outline;
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
      objects.push_back(
          {k, reduced(boxes_[k].outline), boxes_[k].xyxy.bottom, reach_px / reduced_by_});
    }
    return objects;
  }

  ImageSize size_;
  int reduced_by_;
  FramePair pair_;
  std::vector<Box> boxes_;
  StillLayers layers_;
};

class PairMotion final : public Motion {
 public:
  PairMotion(StillImage image, const FramePair& pair, const ImageSpec& spec,
             const std::vector<Box>& boxes, const Placement& placement)
      : image_(std::move(image)),
        still_(grey_if_first({image_.pixels->size, image_.pixels->bgr.data()}, spec)),
        label_position_(pair.label_position),
        placement_(placement),
        moving_(still_.image, image_.size, image_.reduced_by, pair, boxes),
        scaled_(moving_.layers(), placement, {}, image_.reduced_by, resting()) {}

  cv::Mat frame(double u) const override {
    if (u == label_position_) return at_rest(still_.image);
    return scaled_.frame(moving_.background_map(u), moving_.object_maps(u));
  }

  cv::Mat seen(double u) const override { return moving_.layers().seen(moving_.object_maps(u)); }

  AffineMap step(std::size_t number) const override {
    const double u = moving_.moved_end();
    return inverse(number == 0 ? moving_.image_map(u) : moving_.object_map(number - 1, u));
  }

  double displacement_px() const override { return moving_.displacement_px(); }

 private:
  /// The frame of all that rests, if the image does.
  cv::Mat resting() const {
    if (!moving_.image_rests()) return {};
    return at_rest(moving_.layers().resting_frame(moving_.object_maps(moving_.moved_end())));
  }

  /// An image of the still's size and channels as a frame.
  cv::Mat at_rest(const cv::Mat& image) const {
    if (image_.reduced_by == 1) return scaled_grey({image, still_.channels}, placement_);
    const StillLayers background(image, {}, 0);
    return ScaledLayers(background, placement_, {}, image_.reduced_by)
        .frame({1, 0, 0, 0, 1, 0}, {});
  }

  StillImage image_;
  Resizable still_;
  double label_position_;
  Placement placement_;
  MovingLayers moving_;
  ScaledLayers scaled_;
};

/// What all pairs of a clip share.
struct ClipLayers {
  ClipLayers(SharedImage of, const ImageSpec& spec, const std::vector<Box>& boxes,
             const StillPose& pose, const Placement& placement)
      : image(std::move(of)),
        still(grey_if_first({image->size, image->bgr.data()}, spec)),
        clip({image->size, still.image.data, still.channels}, boxes, pose),
        frame(clip.resized(placement)) {}

  SharedImage image;
  Resizable still;
  StillClip clip;
  std::function<GreyImage(const StillPose&)> frame;
};

class ClipMotion final : public Motion {
 public:
  ClipMotion(std::shared_ptr<const ClipLayers> layers, const FramePair& pair)
      : layers_(std::move(layers)),
        from_(pair.poses.at(0)),
        to_(pair.poses.at(1)),
        label_position_(pair.label_position) {}

  cv::Mat frame(double u) const override {
    // The ends exactly, which other pairs of the clip have, too.
    GreyImage grey = layers_->frame(u == 0 ? from_ : u == 1 ? to_ : pose_between(from_, to_, u));
    return cv::Mat(grey.size.height, grey.size.width, CV_8UC1, grey.pixels.data()).clone();
  }

  cv::Mat seen(double u) const override {
    std::vector<std::uint16_t> pixels = layers_->clip.seen(u == 0 ? from_ : to_);
    if (pixels.empty()) return {};
    const ImageSize size = layers_->clip.size();
    return cv::Mat(size.height, size.width, CV_16UC1, pixels.data()).clone();
  }

  AffineMap step(std::size_t number) const override {
    return label_position_ == 0 ? layers_->clip.step(from_, to_, number)
                                : layers_->clip.step(to_, from_, number);
  }

  double displacement_px() const override { return layers_->clip.displacement_px(from_, to_); }

 private:
  std::shared_ptr<const ClipLayers> layers_;
  StillPose from_, to_;
  double label_position_;
};

PixelFlow flow_of(const Motion& motion, double label_position, const Placement& placement,
                  int reduced_by) {
  constexpr double kSteps = 128;  // to a pixel, as in DSEC's files; they compress well, too
  // By way of integers, several times as fast as round().
  const auto stepped = [](double px) {
    return static_cast<double>(std::int64_t(px * kSteps + (px < 0 ? -0.5 : 0.5))) / kSteps;
  };
  const VisiblePart part = visible_part(placement);
  const AffineMap to_volume = placement.source_to_volume(), to_source = inverse(to_volume);
  const AffineMap to_seen = compose(reducing(reduced_by), to_source);
  const cv::Mat here = motion.seen(label_position), there = motion.seen(1 - label_position);
  const auto shown = [&](const cv::Mat& seen, Point at) -> std::size_t {
    if (seen.empty()) return 0;
    const Point place = mapped(to_seen, at);
    const auto nearest = [](double pixel, int count) {
      return static_cast<int>(std::clamp(pixel, 0.0, count - 1.0) + 0.5);
    };
    return seen.at<std::uint16_t>(nearest(place.y, seen.rows), nearest(place.x, seen.cols));
  };
  std::vector<std::optional<AffineMap>> steps;  // from the labelled frame, in the volume
  const auto step_of = [&](std::size_t number) {
    if (steps.size() <= number) steps.resize(number + 1);
    auto& step = steps[number];
    if (!step) step = compose(compose(to_volume, motion.step(number)), to_source);
    return *step;
  };
  const std::size_t pixels = placement.volume.pixel_count();
  PixelFlow flow{std::vector<float>(2 * pixels), std::vector<std::uint8_t>(pixels)};
  const int right = part.volume_x + part.size.width, bottom = part.volume_y + part.size.height;
  const double sign = label_position == 0 ? 1 : -1;  // of time
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

}  // namespace

int still_reduction(ImageSize whole, const ImageSpec& spec, const FramePair& pair) {
  return unless_refused([&] {
    const Placement placement = place(whole, spec, pair);
    const ImageSize cut = placement.cut(), scaled = placement.scaled;
    const auto suffices = [&](int by) {
      return whole.width % by == 0 && whole.height % by == 0 &&
             cut.width / (2 * by) >= scaled.width && cut.height / (2 * by) >= scaled.height;
    };
    int by = std::max(whole.width, whole.height) > kMostStillSide ? 1 : 8;
    while (by > 1 && !suffices(by)) by /= 2;
    return by;
  });
}

struct MovingStill::State {
  ImageSpec spec;
  int reduced_by;
  Placement placement;
  std::shared_ptr<const Motion> pair;      ///< of a still's one pair
  std::shared_ptr<const ClipLayers> clip;  ///< of a clip

  std::shared_ptr<const Motion> motion(const FramePair& of) const {
    return clip ? std::make_shared<const ClipMotion>(clip, of) : pair;
  }
};

MovingStill::MovingStill(StillImage image, const FramePair& pair, const ImageSpec& spec,
                         const std::vector<Box>& boxes)
    : state_(unless_refused([&] {
        State state{
            .spec = spec, .reduced_by = image.reduced_by, .placement = {}, .pair = {}, .clip = {}};
        if (pair.poses.empty()) {
          state.placement = place(image.size, spec, pair);
          state.pair = std::make_shared<const PairMotion>(std::move(image), pair, spec, boxes,
                                                          state.placement);
        } else if (image.reduced_by > 1) {
          throw std::invalid_argument("expected the whole image of a clip, got a reduced one");
        } else {
          state.placement = place(clip_window(image.size).size, spec);
          state.clip = std::make_shared<const ClipLayers>(std::move(image.pixels), spec, boxes,
                                                          pair.poses.at(0), state.placement);
        }
        return std::make_shared<const State>(std::move(state));
      })) {}

const Placement& MovingStill::placement() const { return state_->placement; }

FramesBetween MovingStill::frames(const FramePair& pair) const {
  return unless_refused([&] {
    const auto motion = state_->motion(pair);
    const Placement& placement = state_->placement;
    return FramesBetween{
        [state = state_, motion](double u) {
          return unless_refused([&] {
            return GreyImage{visible_part(state->placement).size,
                             finished(motion->frame(u), state->placement, state->spec)};
          });
        },
        motion->displacement_px() * std::max(placement.scale_x(), placement.scale_y())};
  });
}

PixelFlow MovingStill::flow(const FramePair& pair) const {
  return unless_refused([&] {
    return flow_of(*state_->motion(pair), pair.label_position, state_->placement,
                   state_->reduced_by);
  });
}

ColourFrame move_still(const ColourFrame& image, const FramePair& pair,
                       const std::vector<Box>& boxes) {
  return unless_refused([&] {
    const cv::Mat labelled = matrix_of({image.size, image.bgr.data()});
    const MovingLayers moving(labelled, image.size, 1, pair, boxes);
    const double u = moving.moved_end();
    const cv::Mat result = moving.layers().frame(moving.background_map(u), moving.object_maps(u));
    return ColourFrame{image.size, {result.datastart, result.dataend}};
  });
}

}  // namespace eventgan
