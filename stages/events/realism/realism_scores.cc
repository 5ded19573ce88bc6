#include "stages/events/realism/realism_scores.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "stages/events/realism/agreement_internal.h"
#include "stages/events/time_image.h"
#include "stages/events/volume_statistics.h"

namespace eventgan {
namespace {

void check_sizes(std::size_t volume, std::size_t real, const VolumeShape& shape,
                 const GreyImage& previous, const GreyImage& next) {
  const bool sound = shape.bins >= 1 && shape.size.height >= 1 && shape.size.width >= 1 &&
                     volume == shape.value_count() && real == shape.value_count() &&
                     previous.size == shape.size && next.size == shape.size &&
                     previous.pixels.size() == shape.size.pixel_count() &&
                     next.pixels.size() == shape.size.pixel_count();
  if (!sound) {
    throw std::invalid_argument("expected two volumes [" + std::to_string(shape.channels()) +
                                ", H, W] and two frames of " + std::to_string(shape.size.width) +
                                "x" + std::to_string(shape.size.height) + " pixels, got " +
                                std::to_string(volume) + " and " + std::to_string(real) +
                                " values, frames of " + std::to_string(previous.pixels.size()) +
                                " and " + std::to_string(next.pixels.size()) + " pixels");
  }
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

SummedVolume summed(std::vector<float> volume, const VolumeShape& shape) {
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

/// The average-timestamp pictures side by side, [polarity, y, x]; 0 where there is no event. T does
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
  scores.events_per_bin.assign(static_cast<std::size_t>(shape.bins), 0.0);
  for (int channel = 0; channel < shape.channels(); ++channel) {
    double sum = 0;
    for (std::size_t i = 0; i < plane; ++i) {
      sum += static_cast<double>(volume[static_cast<std::size_t>(channel) * plane + i]);
    }
    scores.events_per_bin[static_cast<std::size_t>(channel % shape.bins)] += sum / pixels;
    if (channel < shape.bins) positive += sum;
    total += sum;
  }
  scores.events_per_pixel = total / pixels;
  scores.positive_share = total > 0 ? positive / total : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

RealismScores realism_scores(std::span<const float> volume, std::span<const float> real,
                             const VolumeShape& shape, const GreyImage& previous,
                             const GreyImage& next) {
  check_sizes(volume.size(), real.size(), shape, previous, next);
  const SummedVolume ours = summed(clipped(volume, "compared"), shape);
  const SummedVolume truth = summed(clipped(real, "real"), shape);
  RealismScores scores;
  scores.f1_raw = binary_match_f1(ours.volume, truth.volume);
  scores.f1_time = binary_match_f1(ours.sums, truth.sums);
  scores.f1_time_polarity =
      binary_match_f1(without_polarity(ours.sums), without_polarity(truth.sums));
  scores.pool_mse_2 = pool_mse(ours.volume, truth.volume, shape.size, 2);
  scores.pool_mse_4 = pool_mse(ours.volume, truth.volume, shape.size, 4);
  scores.time_correlation = pearson(event_times(ours, shape), event_times(truth, shape));
  scores.polarity_correlation = polarity_agreement(ours.sums, previous, next);
  add_amounts(ours.volume, shape, scores);
  return scores;
}

}  // namespace eventgan
