#pragma once

#include "pipeline/simulation/clip_frames.h"
#include "pipeline/simulation/scene.h"

namespace eventgan {

/// How the intensity gets from one frame of a clip to the next.
enum class ClipMotion {
  kFlow,  ///< things move along the dense optical flow (FlowInterval)
  kFade   ///< each pixel fades on a line in log intensity; nothing moves, no flow
};

/// A real clip as a scene: its frames at their times. `clip` must outlive it; members throw
/// InputError as ClipFrames::frame does.
class ClipScene final : public Scene {
 public:
  ClipScene(ClipFrames& clip, ClipMotion motion);
  const GreyImage& frame() const override { return frame_; }
  double time_s() const override { return clip_.time_s(position_); }
  std::unique_ptr<Interval> advance() override;
  bool has_flow() const override { return motion_ == ClipMotion::kFlow; }

 private:
  ClipFrames& clip_;
  ClipMotion motion_;
  std::int64_t position_ = 0;
  GreyImage frame_;
};

}  // namespace eventgan
