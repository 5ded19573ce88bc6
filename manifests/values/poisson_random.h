#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "manifests/values/counter_random.h"

namespace eventgan {

/// ln k! for a whole k >= 0, within 1e-10: Stirling's series of Γ(x) at an x >= 10. The C library's
/// lgamma writes to a variable that all threads share. Pure.
inline double log_factorial(double k) {
  double x = k + 1, product = 1;
  for (; x < 10; ++x) product *= x;
  const double inverse = 1 / x, square = inverse * inverse;
  const double series = inverse * (1.0 / 12 - square * (1.0 / 360 - square / 1260));
  return (x - 0.5) * std::log(x) - x + 0.5 * std::log(2 * std::numbers::pi) + series -
         std::log(product);
}

/// A whole number of Poisson's distribution with a finite mean >= 0, as a double, which holds any.
/// A mean up to 16 takes the uniform number of counter `first` and inverts the distribution; for a
/// larger one counters first, first + stride, ... are rejected until one pair fits (Hörmann 1993,
/// PTRS), so that no mean takes long. Pure.
inline double poisson(double mean, const CounterRandom& random, std::uint64_t first,
                      std::uint64_t stride = 1) {
  constexpr double kLargestInverted = 16;
  if (mean <= kLargestInverted) {
    const double uniform = random.uniform(first);
    if (uniform < 1 - mean) return 0;  // as a rule; exp(-mean) is more
    double probability = std::exp(-mean);
    double sum = probability;
    double count = 0;
    while (uniform >= sum && probability > 0) {
      probability *= mean / ++count;
      sum += probability;
    }
    return count;
  }
  const double b = 0.931 + 2.53 * std::sqrt(mean);
  const double a = -0.059 + 0.02483 * b;
  const double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
  const double most_v = 0.9277 - 3.6224 / (b - 2);
  for (std::uint64_t counter = first;; counter += 2 * stride) {
    const double u = random.uniform(counter) - 0.5;
    const double v = random.uniform(counter + stride);
    const double distance = 0.5 - std::abs(u);
    const double count = std::floor((2 * a / distance + b) * u + mean + 0.43);
    if (distance >= 0.07 && v <= most_v) return count;
    if (!(count >= 0) || (distance < 0.013 && v > distance)) continue;
    const double hat = v * inverse_alpha / (a / (distance * distance) + b);
    if (std::log(hat) <= count * std::log(mean) - mean - log_factorial(count)) return count;
  }
}

}  // namespace eventgan
