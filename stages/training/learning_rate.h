#pragma once

#include <cstdint>

namespace eventgan {

/// The rate of step 0..steps-1 of a phase, falling from `rate` to final_fraction · rate by half a
/// cosine: rate · (f + (1 - f) · (1 + cos(π step / steps)) / 2). Steps from `steps` on have the
/// final rate.
double learning_rate(double rate, double final_fraction, std::int64_t step, std::int64_t steps);

}  // namespace eventgan
