#pragma once

#include <cstdint>
#include <memory>

#include "manifests/values/frames.h"
#include "pipeline/simulation/clip_frames.h"
#include "stages/events/simulation/affine_motion.h"
#include "stages/events/simulation/interval.h"

namespace eventgan {

/// What a simulated camera looks at in one recording: frames at rising times, and what moves
/// between them, one after another. Not thread safe.
class Scene {
 public:
  virtual ~Scene() = default;

  /// The frame where the scene is, and its time; it starts at its first frame, at 0 s.
  virtual const GreyImage& frame() const = 0;
  virtual double time_s() const = 0;

  /// Moves on to the next frame and returns what the sensor sees on the way; null at the end.
  virtual std::unique_ptr<Interval> advance() = 0;

  /// Whether the intervals know their flow.
  virtual bool has_flow() const = 0;
};

/// One image under one steady affine motion, seen in n = frame_count frames: frame k is the
/// image at u = (k + 1)/n of the motion, rounded to 8 bits, so pairs any number of frames apart
/// have a motion as far in proportion. The image itself, u = 0, is no frame: it alone is not
/// smoothed by interpolation, and that would look like events. In each interval at most 1 px lies
/// between two images of the sensor.
class AffineScene final : public Scene {
 public:
  /// frame_count ≥ 2; frames are `interval_s` apart.
  AffineScene(GreyImage image, const AffineMotion& motion, int frame_count, double interval_s);
  const GreyImage& frame() const override { return frame_; }
  double time_s() const override { return position_ * interval_s_; }
  std::unique_ptr<Interval> advance() override;
  bool has_flow() const override { return true; }

 private:
  GreyImage image_;
  AffineMotion motion_;
  int frame_count_;
  double interval_s_;
  int position_ = 0;
  GreyImage frame_;
};

/// A real clip as a scene: its frames at their times. `clip` must outlive it; members throw
/// InputError as ClipFrames::frame does. `between`: what is seen from one frame to the next,
/// without flow; null: things move along the dense optical flow (FlowInterval).
class ClipScene final : public Scene {
 public:
  using Between = std::unique_ptr<Interval> (*)(GreyImage previous, GreyImage next);
  explicit ClipScene(ClipFrames& clip, Between between = nullptr);
  const GreyImage& frame() const override { return frame_; }
  double time_s() const override { return clip_.time_s(position_); }
  std::unique_ptr<Interval> advance() override;
  bool has_flow() const override { return between_ == nullptr; }

 private:
  ClipFrames& clip_;
  Between between_;
  std::int64_t position_ = 0;
  GreyImage frame_;
};

}  // namespace eventgan
