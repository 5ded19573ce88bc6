#include "stages/events/realism/realism_scores.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "stages/events/event_volume.h"
#include "stages/events/volume_statistics.h"

namespace eventgan {
namespace {

double mean(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

bool constant(std::span<const double> values) {
  return std::ranges::all_of(values, [&](double value) { return value == values.front(); });
}

/// Mean difference of one block of one plane: pooling is linear, so the difference of the means.
double block_difference(const float* values, const float* real, ImageSize size, int top, int left,
                        int side) {
  const int bottom = std::min(top + side, size.height);
  const int right = std::min(left + side, size.width);
  double sum = 0;
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(y) * size.width + x;
      sum += static_cast<double>(values[at]) - static_cast<double>(real[at]);
    }
  }
  return sum / ((bottom - top) * (right - left));
}

/// F1 = 2 TP / (2 TP + FP + FN) of "is an event" (value > kEventThreshold), position by position;
/// 1 if neither has an event. Spans of one size.
double binary_match_f1(std::span<const float> values, std::span<const float> real) {
  std::size_t both = 0;
  std::size_t events = 0;  // 2 TP + FP + FN: the events of one plus those of the other
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool here = values[i] > kEventThreshold;
    const bool there = real[i] > kEventThreshold;
    both += here && there;
    events += static_cast<std::size_t>(here) + static_cast<std::size_t>(there);
  }
  return events == 0 ? 1.0 : 2.0 * static_cast<double>(both) / static_cast<double>(events);
}

/// Mean squared difference of two arrays [planes, y, x] after mean pooling over blocks of
/// side x side pixels, every block counting alike; a block cut by the border is the mean of what it
/// has.
double pool_mse(std::span<const float> values, std::span<const float> real, ImageSize size,
                int side) {
  const std::size_t plane = size.pixel_count();
  double sum = 0;
  std::size_t blocks = 0;
  for (std::size_t start = 0; start < values.size(); start += plane) {
    for (int top = 0; top < size.height; top += side) {
      for (int left = 0; left < size.width; left += side) {
        const double difference =
            block_difference(values.data() + start, real.data() + start, size, top, left, side);
        sum += difference * difference;
        ++blocks;
      }
    }
  }
  return sum / static_cast<double>(blocks);
}

/// Pearson correlation; NaN if there are no values or one side is constant.
double pearson(std::span<const double> a, std::span<const double> b) {
  // Exactly: a sum of squares about the mean is seldom exactly zero for a constant.
  if (a.empty() || constant(a) || constant(b)) return std::numeric_limits<double>::quiet_NaN();
  const double mean_a = mean(a);
  const double mean_b = mean(b);
  double covariance = 0;
  double variance_a = 0;
  double variance_b = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double from_a = a[i] - mean_a;
    const double from_b = b[i] - mean_b;
    covariance += from_a * from_b;
    variance_a += from_a * from_a;
    variance_b += from_b * from_b;
  }
  return covariance / std::sqrt(variance_a * variance_b);
}

void check_sizes(std::size_t values, const VolumeShape& shape) {
  if (shape.bins >= 1 && shape.size.height >= 1 && shape.size.width >= 1 &&
      values == shape.value_count()) {
    return;
  }
  throw std::invalid_argument("expected a volume [" + std::to_string(shape.channels()) +
                              ", H, W] of " + to_string(shape.size) + " pixels, got " +
                              std::to_string(values) + " values");
}

void check_frame(const GreyImage& frame, ImageSize size) {
  if (frame.size == size && frame.pixels.size() == size.pixel_count()) return;
  throw std::invalid_argument("expected a frame of " + to_string(size) + " pixels, got " +
                              std::to_string(frame.pixels.size()) + " pixels");
}

std::vector<float> clipped(std::span<const float> volume, const char* name) {
  if (const std::size_t bad = first_unsound_value(volume); bad != volume.size()) {
    throw std::invalid_argument(std::string("expected finite values >= 0, got ") +
                                std::to_string(volume[bad]) + " in the " + name + " volume");
  }
  std::vector<float> result(volume.begin(), volume.end());
  for (float& value : result) value = std::min(value, 1.0f);
  return result;
}

/// A normalised volume and its sums over time, [polarity, y, x]: positive, then negative.
struct SummedVolume {
  std::vector<float> volume;
  std::vector<float> sums;
};

SummedVolume summed(std::span<const float> values, const VolumeShape& shape, const char* name) {
  check_sizes(values.size(), shape);
  std::vector<float> volume = clipped(values, name);
  const std::size_t plane = shape.size.pixel_count();
  std::vector<float> sums(2 * plane, 0.0f);
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const std::size_t polarity = i / (static_cast<std::size_t>(shape.bins) * plane);
    sums[polarity * plane + i % plane] += volume[i];
  }
  return {std::move(volume), std::move(sums)};
}

/// Both polarities together: [y, x].
std::vector<float> without_polarity(const std::vector<float>& sums) {
  const std::size_t plane = sums.size() / 2;
  std::vector<float> both(plane);
  for (std::size_t i = 0; i < plane; ++i) both[i] = sums[i] + sums[plane + i];
  return both;
}

/// The average-timestamp images side by side, [polarity, y, x]; 0 where there is no event. T does
/// not fade with the volume: without the threshold, traces far below an event would count as fully
/// as events do.
std::vector<double> event_times(const SummedVolume& volume, const VolumeShape& shape) {
  const TimeImage image = time_image(volume.volume, shape);
  std::vector<double> times(image.positive.begin(), image.positive.end());
  times.insert(times.end(), image.negative.begin(), image.negative.end());
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (volume.sums[i] <= kEventThreshold) times[i] = 0;
  }
  return times;
}

double polarity_agreement(const std::vector<float>& sums, const GreyImage& previous,
                          const GreyImage& next) {
  const std::size_t plane = previous.pixels.size();
  std::vector<double> polarity(plane);
  std::vector<double> change(plane);
  for (std::size_t i = 0; i < plane; ++i) {
    polarity[i] = static_cast<double>(sums[i]) - static_cast<double>(sums[plane + i]);
    change[i] = std::log((next.pixels[i] + 1.0) / (previous.pixels[i] + 1.0));
  }
  return pearson(polarity, change);
}

void add_amounts(const std::vector<float>& volume, const VolumeShape& shape,
                 RealismScores& scores) {
  const std::size_t plane = shape.size.pixel_count();
  const auto pixels = static_cast<double>(plane);
  double positive = 0;
  double total = 0;
  for (int channel = 0; channel < shape.channels(); ++channel) {
    double sum = 0;
    for (std::size_t i = 0; i < plane; ++i) {
      sum += static_cast<double>(volume[static_cast<std::size_t>(channel) * plane + i]);
    }
    scores.events_per_channel.push_back(sum / pixels);
    if (channel < shape.bins) positive += sum;
    total += sum;
  }
  scores.events_per_pixel = total / pixels;
  scores.positive_share = total > 0 ? positive / total : std::numeric_limits<double>::quiet_NaN();
}

/// What realism_scores says without the frames.
RealismScores matches(const SummedVolume& ours, const SummedVolume& truth,
                      const VolumeShape& shape) {
  RealismScores scores;
  scores.f1_raw = binary_match_f1(ours.volume, truth.volume);
  scores.f1_time = binary_match_f1(ours.sums, truth.sums);
  scores.f1_time_polarity =
      binary_match_f1(without_polarity(ours.sums), without_polarity(truth.sums));
  scores.time_correlation = pearson(event_times(ours, shape), event_times(truth, shape));
  return scores;
}

}  // namespace

RealismScores realism_scores(std::span<const float> volume, std::span<const float> real,
                             const VolumeShape& shape, const GreyImage& previous,
                             const GreyImage& next) {
  const SummedVolume ours = summed(volume, shape, "compared");
  const SummedVolume truth = summed(real, shape, "real");
  check_frame(previous, shape.size);
  check_frame(next, shape.size);
  RealismScores scores = matches(ours, truth, shape);
  scores.pool_mse_2 = pool_mse(ours.volume, truth.volume, shape.size, 2);
  scores.pool_mse_4 = pool_mse(ours.volume, truth.volume, shape.size, 4);
  scores.polarity_correlation = polarity_agreement(ours.sums, previous, next);
  add_amounts(ours.volume, shape, scores);
  return scores;
}

std::vector<float> events_over_time(std::span<const float> volume, const VolumeShape& shape) {
  return summed(volume, shape, "given").sums;
}

RealismScores match_scores(std::span<const float> volume, std::span<const float> real,
                           const VolumeShape& shape) {
  RealismScores scores =
      matches(summed(volume, shape, "compared"), summed(real, shape, "real"), shape);
  for (double RealismScores::*field :
       {&RealismScores::pool_mse_2, &RealismScores::pool_mse_4,
        &RealismScores::polarity_correlation, &RealismScores::events_per_pixel,
        &RealismScores::positive_share}) {
    scores.*field = std::numeric_limits<double>::quiet_NaN();
  }
  return scores;
}

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

/// Mean over those of `pairs`, indices, where `value_of` gives a number.
template <class Pairs, class ValueOf>
double mean_of_numbers(const Pairs& pairs, ValueOf value_of) {
  double sum = 0;
  int count = 0;
  for (const std::size_t pair : pairs) {
    const double value = value_of(pair);
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

/// What `reduce` makes of each number that scores have, in their place; it is given
/// value_of(index).
template <class Reduce>
RealismScores field_by_field(std::span<const RealismScores> scores, Reduce reduce) {
  RealismScores result;
  for (const auto field : kFields) {
    result.*field = reduce([&, field](std::size_t i) { return scores[i].*field; });
  }
  if (scores.empty()) return result;
  const std::size_t channels = scores.front().events_per_channel.size();
  for (const RealismScores& pair : scores) {
    if (pair.events_per_channel.size() != channels) {
      throw std::invalid_argument("expected scores with one number of channels, got " +
                                  std::to_string(channels) + " and " +
                                  std::to_string(pair.events_per_channel.size()));
    }
  }
  for (std::size_t channel = 0; channel < channels; ++channel) {
    result.events_per_channel.push_back(
        reduce([&, channel](std::size_t i) { return scores[i].events_per_channel[channel]; }));
  }
  return result;
}

}  // namespace

std::vector<double> RealismScores::events_per_bin() const {
  const std::size_t bins = events_per_channel.size() / 2;
  std::vector<double> sums(events_per_channel.begin(),
                           events_per_channel.begin() + static_cast<std::ptrdiff_t>(bins));
  for (std::size_t bin = 0; bin < bins; ++bin) sums[bin] += events_per_channel[bins + bin];
  return sums;
}

double share_distance(const RealismScores& scores, const RealismScores& real) {
  const std::size_t channels = real.events_per_channel.size();
  if (scores.events_per_channel.size() != channels) {
    throw std::invalid_argument("expected scores with one number of channels, got " +
                                std::to_string(channels) + " and " +
                                std::to_string(scores.events_per_channel.size()));
  }
  double distance = 0;
  for (std::size_t i = 0; i < channels; ++i) {
    distance += std::abs(scores.events_per_channel[i] / scores.events_per_pixel -
                         real.events_per_channel[i] / real.events_per_pixel);
  }
  return channels > 0 ? distance : std::numeric_limits<double>::quiet_NaN();
}

RealismScores mean_scores(std::span<const RealismScores> scores) {
  std::vector<std::size_t> all(scores.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return field_by_field(scores,
                        [&](const auto& value_of) { return mean_of_numbers(all, value_of); });
}

namespace {

constexpr int kDraws = 1000;
constexpr std::size_t kFewestPairs = 3;

}  // namespace

double quantile(std::span<const double> sorted, double share) {
  if (sorted.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double rank = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(rank);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (rank - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

Bounds bootstrap_bounds(std::size_t pairs,
                        const std::function<double(std::span<const std::size_t>)>& statistic) {
  if (pairs < kFewestPairs) return {};
  const CounterRandom random = CounterRandom(0).keyed("bootstrap");
  std::vector<double> values;
  std::vector<std::size_t> drawn(pairs);
  for (int draw = 0; draw < kDraws; ++draw) {
    for (std::size_t i = 0; i < pairs; ++i) {
      drawn[i] = random.below(static_cast<std::uint64_t>(draw) * pairs + i, pairs);
    }
    if (const double value = statistic(drawn); !std::isnan(value)) values.push_back(value);
  }
  std::ranges::sort(values);
  return {quantile(values, 0.025), quantile(values, 0.975)};
}

ScoreBounds mean_bounds(std::span<const RealismScores> scores) {
  const auto end_of = [&](double Bounds::*end) {
    return field_by_field(scores, [&](const auto& value_of) {
      return bootstrap_bounds(scores.size(),
                              [&](std::span<const std::size_t> drawn) {
                                return mean_of_numbers(drawn, value_of);
                              }).*
             end;
    });
  };
  return {end_of(&Bounds::low), end_of(&Bounds::high)};
}

}  // namespace eventgan
