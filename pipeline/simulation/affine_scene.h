#pragma once

#include "pipeline/simulation/scene.h"
#include "stages/events/simulation/affine_motion.h"

namespace eventgan {

/// One picture under one steady affine motion, seen in n = frame_count frames: frame k is the
/// picture at u = (k + 1)/n of the motion, rounded to 8 bits, so pairs any number of frames apart
/// have a motion as far in proportion. The picture itself, u = 0, is no frame: it alone is not
/// smoothed by interpolation, and that would look like events. In each interval at most 1 px lies
/// between two pictures of the sensor.
class AffineScene final : public Scene {
 public:
  /// frame_count ≥ 2; frames are `interval_s` apart.
  AffineScene(GreyImage picture, const AffineMotion& motion, int frame_count, double interval_s);
  const GreyImage& frame() const override { return frame_; }
  double time_s() const override { return position_ * interval_s_; }
  std::unique_ptr<Interval> advance() override;
  bool has_flow() const override { return true; }

 private:
  GreyImage picture_;
  AffineMotion motion_;
  int frame_count_;
  double interval_s_;
  int position_ = 0;
  GreyImage frame_;
};

}  // namespace eventgan
