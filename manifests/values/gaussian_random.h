#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "manifests/values/counter_random.h"

namespace eventgan {

/// A number of the normal distribution with mean 0 for an index, by Box and Muller's cosine from
/// random.uniform() of 2 index and 2 index + 1. Weights and simulated sensors depend on its last
/// bits: deviation and radius are multiplied first. Pure.
inline double gaussian(const CounterRandom& random, std::uint64_t index, double deviation = 1) {
  // 1 - uniform lies in (0, 1]: its logarithm is finite.
  const double radius = std::sqrt(-2 * std::log(1 - random.uniform(2 * index)));
  return deviation * radius * std::cos(2 * std::numbers::pi * random.uniform(2 * index + 1));
}

}  // namespace eventgan
