#pragma once

#include <string>
#include <vector>

#include "pipeline/realism/real_interval.h"

namespace eventgan {

/// Something that makes event volumes of frames, to be compared with a camera's.
class VolumeMethod {
 public:
  virtual ~VolumeMethod() = default;

  virtual std::string name() const = 0;      ///< a word: "network", "difference", "esim"
  virtual std::string settings() const = 0;  ///< what its volumes depend on, for the report
  virtual int draws() const = 0;             ///< volumes for an interval; above 1 if it is random

  /// Volume number `draw`: [2 bins, y, x] float32, ≥ 0, normalised (a simulator's counts
  /// divided by their η98, the network's values as it gives them). Thread safe.
  virtual std::vector<float> volume(const IntervalFrames& frames, int draw) const = 0;
};

}  // namespace eventgan
