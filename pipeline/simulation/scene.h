#pragma once

#include <cstdint>
#include <memory>

#include "manifests/grey_image.h"
#include "stages/events/simulation/interval.h"

namespace eventgan {

/// What a simulated camera looks at in one recording: frames at rising times, and what moves
/// between them, one after another. Not thread safe.
class Scene {
 public:
  virtual ~Scene() = default;

  /// The frame where the scene stands, and its time; it starts at its first frame, at 0 s.
  virtual const GreyImage& frame() const = 0;
  virtual double time_s() const = 0;

  /// Moves on to the next frame and returns what the sensor sees on the way; null at the end.
  virtual std::unique_ptr<Interval> advance() = 0;

  /// Whether the intervals know their flow.
  virtual bool has_flow() const = 0;
};

}  // namespace eventgan
