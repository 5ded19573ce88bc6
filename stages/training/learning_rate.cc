#include "stages/training/learning_rate.h"

#include <cmath>
#include <numbers>

namespace eventgan {

double learning_rate(double rate, double final_fraction, std::int64_t step, std::int64_t steps) {
  const double progress = step < steps ? double(step) / double(steps) : 1;
  const double fall = (1 + std::cos(std::numbers::pi * progress)) / 2;
  return rate * (final_fraction + (1 - final_fraction) * fall);
}

}  // namespace eventgan
