#pragma once

#include <vector>

#include "manifests/values/frames.h"

namespace eventgan {

/// Displacement of each pixel over an interval, previous → next, in pixels; [y, x] float32 each.
struct FlowDisplacement {
  ImageSize size;
  std::vector<float> x_px;
  std::vector<float> y_px;
};

/// What a sensor sees between two frames: images close enough to each other that no point moves
/// more than a pixel from one to the next. Thread safe.
class Interval {
 public:
  virtual ~Interval() = default;

  virtual ImageSize size() const = 0;

  /// Images after the first: at least 1.
  virtual int steps() const = 0;

  /// Intensity at step / steps() of the interval, 0 ≤ step ≤ steps(): [y, x] float32 in [0, 1].
  virtual std::vector<float> render(int step) const = 0;

  virtual FlowDisplacement flow() const = 0;
};

}  // namespace eventgan
