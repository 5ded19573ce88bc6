#include "pipeline/realism/still_pixels.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>

#include "stages/events/realism/realism_scores.h"

namespace eventgan {
namespace {

constexpr int kReach = 2;  // of 5x5 pixels
constexpr std::size_t kLeastPixels = 100;
constexpr std::size_t kPairsOfRange = 10;
constexpr double kEventsOfRange = 400;
constexpr std::size_t kLeastHotEvents = 5;
constexpr double kLeastHot_hz = 5;
constexpr double kHotTimes = 20;
constexpr double kMostActive = 0.01;  // of the pixels

std::vector<int> changes(const GreyImage& previous, const GreyImage& next) {
  std::vector<int> change(previous.pixels.size());
  for (std::size_t i = 0; i < change.size(); ++i) {
    change[i] = std::abs(int{next.pixels[i]} - int{previous.pixels[i]});
  }
  return change;
}

/// Sums of the values at most kReach away along lines: `count` values, `stride` apart.
void sum_along(std::span<const int> values, std::span<int> sums, std::size_t start, int count,
               std::size_t stride) {
  const auto at = [&](int i) { return start + static_cast<std::size_t>(i) * stride; };
  int sum = 0;
  for (int i = 0; i < std::min(kReach, count); ++i) sum += values[at(i)];
  for (int i = 0; i < count; ++i) {
    if (i + kReach < count) sum += values[at(i + kReach)];
    sums[at(i)] = sum;
    if (i >= kReach) sum -= values[at(i - kReach)];
  }
}

int pixels_near(int i, int count) {
  return std::min(i + kReach, count - 1) - std::max(i - kReach, 0) + 1;
}

bool is_clipped(std::uint8_t level) { return level == 0 || level == 255; }

}  // namespace

StillPixels find_still_pixels(const GreyImage& previous, const GreyImage& next,
                              std::span<const Event> events, double duration_s) {
  const auto [height, width] = previous.size;
  const auto stride = static_cast<std::size_t>(width);
  const std::vector<int> change = changes(previous, next);
  std::vector<int> rows(change.size()), sums(change.size());
  for (int y = 0; y < height; ++y) {
    sum_along(change, rows, static_cast<std::size_t>(y) * stride, width, 1);
  }
  for (int x = 0; x < width; ++x) {
    sum_along(rows, sums, static_cast<std::size_t>(x), height, stride);
  }
  StillPixels found{duration_s, std::vector<std::uint8_t>(change.size()), {}, {}};
  std::size_t i = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++i) {
      const int near = pixels_near(y, height) * pixels_near(x, width);
      found.still[i] = change[i] <= kStillLevels && sums[i] <= kStillLevels * near &&
                       !is_clipped(previous.pixels[i]) && !is_clipped(next.pixels[i]);
    }
  }
  for (const Event& event : events) {
    const auto pixel = static_cast<std::uint32_t>(event.y * width + event.x);
    if (found.still[pixel]) (event.positive ? found.positive : found.negative).push_back(pixel);
  }
  return found;
}

namespace {

/// Of each pixel of a recording what it saw while it was still.
struct PixelTotals {
  std::vector<double> seconds;
  std::vector<std::size_t> events;
};

PixelTotals totals_of(std::span<const StillPixels> pairs) {
  PixelTotals totals{std::vector<double>(pairs.front().still.size()),
                     std::vector<std::size_t>(pairs.front().still.size())};
  for (const StillPixels& pair : pairs) {
    for (std::size_t i = 0; i < pair.still.size(); ++i) {
      if (pair.still[i]) totals.seconds[i] += pair.duration_s;
    }
    for (const auto* events : {&pair.positive, &pair.negative}) {
      for (const std::uint32_t pixel : *events) ++totals.events[pixel];
    }
  }
  return totals;
}

/// Events a second of the pixels that were still, but for the most active ones.
double mean_hz(const PixelTotals& totals, std::span<const double> rates_hz) {
  std::vector<std::size_t> pixels;
  for (std::size_t i = 0; i < rates_hz.size(); ++i) {
    if (totals.seconds[i] > 0) pixels.push_back(i);
  }
  std::ranges::sort(pixels, {}, [&](std::size_t i) { return rates_hz[i]; });
  pixels.resize(pixels.size() -
                static_cast<std::size_t>(std::ceil(kMostActive * double(pixels.size()))));
  double events = 0, seconds = 0;
  for (const std::size_t i : pixels) {
    events += static_cast<double>(totals.events[i]);
    seconds += totals.seconds[i];
  }
  return seconds > 0 ? events / seconds : 0;
}

/// 1 for each pixel that is hot.
std::vector<std::uint8_t> hot_pixels_of(const PixelTotals& totals) {
  std::vector<std::uint8_t> hot(totals.events.size());
  std::vector<double> rates_hz(hot.size()), others_hz;
  for (std::size_t i = 0; i < hot.size(); ++i) {
    if (totals.events[i] == 0) continue;
    rates_hz[i] = static_cast<double>(totals.events[i]) / totals.seconds[i];
    hot[i] = totals.events[i] >= kLeastHotEvents && rates_hz[i] > kLeastHot_hz;
    if (!hot[i]) others_hz.push_back(rates_hz[i]);
  }
  double usual_hz = mean_hz(totals, rates_hz);
  std::ranges::sort(others_hz);
  if (!others_hz.empty()) usual_hz = std::max(usual_hz, quantile(others_hz, 0.5));
  for (std::size_t i = 0; i < hot.size(); ++i) {
    hot[i] = hot[i] && rates_hz[i] > kHotTimes * usual_hz;
  }
  return hot;
}

/// Events of pixels that are not hot, and for how long these were still.
struct NoiseCount {
  double positive = 0;
  double negative = 0;
  double pixel_seconds = 0;

  double positive_hz() const { return positive / pixel_seconds; }
  double negative_hz() const { return negative / pixel_seconds; }
  double shot_hz() const { return 2 * std::min(positive_hz(), negative_hz()); }
  double leak_hz() const { return std::max(0.0, positive_hz() - negative_hz()); }
};

NoiseCount count_noise(const StillPixels& pair, std::span<const std::uint8_t> hot) {
  std::size_t pixels = 0;
  for (std::size_t i = 0; i < hot.size(); ++i) pixels += pair.still[i] && !hot[i];
  const auto cool = [&](const std::vector<std::uint32_t>& events) {
    return static_cast<double>(
        std::ranges::count_if(events, [&](std::uint32_t pixel) { return !hot[pixel]; }));
  };
  return {cool(pair.positive), cool(pair.negative), static_cast<double>(pixels) * pair.duration_s};
}

/// Those whose number of events says more than chance.
std::vector<NoiseCount> telling_pairs(std::span<const NoiseCount> pairs, const NoiseCount& all) {
  std::vector<NoiseCount> telling;
  std::ranges::copy_if(pairs, std::back_inserter(telling), [&](const NoiseCount& pair) {
    return (all.positive_hz() + all.negative_hz()) * pair.pixel_seconds >= kEventsOfRange;
  });
  return telling;
}

std::array<double, 2> range_of(std::span<const NoiseCount> telling, const NoiseCount& all,
                               double (NoiseCount::*rate_hz)() const) {
  if (telling.size() < kPairsOfRange) return {(all.*rate_hz)(), (all.*rate_hz)()};
  std::vector<double> rates_hz;
  for (const NoiseCount& pair : telling) rates_hz.push_back((pair.*rate_hz)());
  std::ranges::sort(rates_hz);
  return {quantile(rates_hz, 0.1), quantile(rates_hz, 0.9)};
}

}  // namespace

std::optional<NoiseFit> fit_noise(std::span<const std::vector<StillPixels>> recordings) {
  NoiseFit fit;
  NoiseCount all;
  std::vector<NoiseCount> counts;
  for (const std::vector<StillPixels>& pairs : recordings) {
    std::vector<std::uint8_t>& hot = fit.hot.emplace_back();
    if (pairs.empty()) continue;
    const PixelTotals totals = totals_of(pairs);
    hot = hot_pixels_of(totals);
    fit.pixels +=
        totals.seconds.size() - static_cast<std::size_t>(std::ranges::count(totals.seconds, 0.0));
    fit.hot_pixels += static_cast<std::size_t>(std::ranges::count(hot, 1));
    for (const StillPixels& pair : pairs) {
      const NoiseCount count = count_noise(pair, hot);
      if (count.pixel_seconds < static_cast<double>(kLeastPixels) * pair.duration_s) continue;
      counts.push_back(count);
      all.positive += count.positive;
      all.negative += count.negative;
      all.pixel_seconds += count.pixel_seconds;
    }
  }
  if (counts.empty()) return std::nullopt;
  const double hot_share = static_cast<double>(fit.hot_pixels) / static_cast<double>(fit.pixels);
  const std::vector<NoiseCount> telling = telling_pairs(counts, all);
  fit.noise.shot_hz = range_of(telling, all, &NoiseCount::shot_hz);
  fit.noise.leak_hz = range_of(telling, all, &NoiseCount::leak_hz);
  fit.noise.hot_pixels = {hot_share, hot_share};
  fit.positive_hz = all.positive_hz();
  fit.negative_hz = all.negative_hz();
  fit.pixel_seconds = all.pixel_seconds;
  fit.pairs = counts.size();
  return fit;
}

}  // namespace eventgan
