#pragma once

#include "manifests/counter_random.h"

namespace eventgan {

/// A surface pattern without end: random values on a grid of whole numbers, smooth between them. A
/// pure function of the place, so that a moving surface carries its pattern with it.
class Texture {
 public:
  explicit Texture(CounterRandom random) : random_(random) {}

  /// One value per cell of the grid, uniform in [0, 1).
  float cell(int x, int y) const;

  /// Smooth noise in [0, 1) that varies over a distance of about 1.
  float noise(double x, double y) const;

 private:
  CounterRandom random_;
};

}  // namespace eventgan
