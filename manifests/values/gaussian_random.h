#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numbers>

#include "manifests/values/counter_random.h"

namespace eventgan {

/// What the absolute value of gaussian() is at most, for its first uniform number: rises with it.
/// Pure.
inline double gaussian_radius(double uniform) {
  // 1 - uniform lies in (0, 1]: its logarithm is finite.
  return std::sqrt(-2 * std::log(1 - uniform));
}

/// A number of the normal distribution with mean 0 for an index, by Box and Muller's cosine from
/// random.uniform() of 2 index and 2 index + 1. Weights and simulated sensors depend on its last
/// bits: deviation and radius are multiplied first. Pure.
inline double gaussian(const CounterRandom& random, std::uint64_t index, double deviation = 1) {
  return deviation * gaussian_radius(random.uniform(2 * index)) *
         std::cos(2 * std::numbers::pi * random.uniform(2 * index + 1));
}

inline constexpr double kNearGaussianError = 1e-9;

/// gaussian() with deviation 1 to within kNearGaussianError, without a call or a branch, so that a
/// loop of it can be vectorised. Its last bits depend on the processor. Pure.
inline double near_gaussian(const CounterRandom& random, std::uint64_t index) {
  // ln(m 2^e) = e ln 2 + 2 artanh t, t = (m - 1)/(m + 1), with m in [sqrt(1/2), sqrt(2)].
  const auto bits = std::bit_cast<std::uint64_t>(1 - random.uniform(2 * index));
  const double fraction = std::bit_cast<double>((bits & 0xfffffffffffff) | 0x3ff0000000000000);
  const bool upper = fraction > std::numbers::sqrt2;
  // The exponent's bits as the last ones of 2^52.
  const double exponent =
      std::bit_cast<double>((bits >> 52) | 0x4330000000000000) - (0x1p52 + 1023) + (upper ? 1 : 0);
  const double m = upper ? fraction / 2 : fraction;
  const double t = (m - 1) / (m + 1);
  const double t2 = t * t;
  double artanh = 1.0 / 13;
  for (const double term : {1.0 / 11, 1.0 / 9, 1.0 / 7, 1.0 / 5, 1.0 / 3, 1.0}) {
    artanh = artanh * t2 + term;
  }
  const double minus_log = -(exponent * std::numbers::ln2 + 2 * t * artanh);
  // cos(2 pi u) = sin(2 pi (|u - 1/2| - 1/4)), of an angle in [-pi/2, pi/2].
  const double turned = std::abs(random.uniform(2 * index + 1) - 0.5) - 0.25;
  const double angle = 2 * std::numbers::pi * turned;
  const double angle2 = angle * angle;
  double sine = 1;
  for (const double factors :
       {16.0 * 17, 14.0 * 15, 12.0 * 13, 10.0 * 11, 8.0 * 9, 6.0 * 7, 4.0 * 5, 2.0 * 3}) {
    sine = 1 - sine * angle2 * (1 / factors);
  }
  return std::sqrt(2 * minus_log) * angle * sine;
}

}  // namespace eventgan
