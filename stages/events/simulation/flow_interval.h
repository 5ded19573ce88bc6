#pragma once

#include <memory>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/events/simulation/interval.h"

namespace eventgan {

/// Frames between two real ones by dense optical flow (OpenCV's DIS, medium preset, forward and
/// backward; Kroeger et al. 2016). At the time u the flow f of what is at a pixel x is
/// projected from both frames (project_flow), and
///   I(u, x) = (w₀ I₀(x - u f) + w₁ I₁(x + (1-u) f)) / (w₀ + w₁),
/// w₀ = (1-u) v₀, w₁ = u v₁, where vᵢ falls to near 0 if frame i has another flow there (the point
/// is covered) or the place lies outside it: then the frame that sees the point counts. I(0) and
/// I(1) are the frames themselves. Steps: the 99.5th percentile of both flows' lengths in pixels,
/// rounded up, 1..64. The bytes do not depend on the number of threads.
class FlowInterval : public Interval {
 public:
  /// Throws std::invalid_argument if the frames are empty or differ in size, std::runtime_error if
  /// OpenCV fails.
  FlowInterval(const GreyImage& previous, const GreyImage& next);
  ~FlowInterval() override;

  ImageSize size() const override;
  int steps() const override { return steps_; }
  std::vector<float> render(int step) const override;
  FlowDisplacement flow() const override;

 private:
  struct Frames;

  std::unique_ptr<const Frames> frames_;
  int steps_ = 1;
};

}  // namespace eventgan
