#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "stages/events/realism/realism_scores.h"

namespace eventgan {
namespace {

constexpr double RealismScores::*kFields[] = {&RealismScores::f1_raw,
                                              &RealismScores::f1_time,
                                              &RealismScores::f1_time_polarity,
                                              &RealismScores::pool_mse_2,
                                              &RealismScores::pool_mse_4,
                                              &RealismScores::time_correlation,
                                              &RealismScores::polarity_correlation,
                                              &RealismScores::events_per_pixel,
                                              &RealismScores::positive_share};

/// Mean over the pairs where `value_of` gives a number.
template <class ValueOf>
double mean_of_numbers(std::span<const RealismScores> scores, ValueOf value_of) {
  double sum = 0;
  int count = 0;
  for (const RealismScores& pair : scores) {
    const double value = value_of(pair);
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

RealismScores mean_scores(std::span<const RealismScores> scores) {
  RealismScores mean;
  for (const auto field : kFields) {
    mean.*field = mean_of_numbers(scores, [&](const RealismScores& pair) { return pair.*field; });
  }
  if (scores.empty()) return mean;
  const std::size_t bins = scores.front().events_per_bin.size();
  for (const RealismScores& pair : scores) {
    if (pair.events_per_bin.size() != bins) {
      throw std::invalid_argument("expected scores with one number of time bins, got " +
                                  std::to_string(bins) + " and " +
                                  std::to_string(pair.events_per_bin.size()));
    }
  }
  for (std::size_t bin = 0; bin < bins; ++bin) {
    mean.events_per_bin.push_back(mean_of_numbers(
        scores, [&](const RealismScores& pair) { return pair.events_per_bin[bin]; }));
  }
  return mean;
}

}  // namespace eventgan
