#include "stages/recordings/readers/detail/time_unit.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

constexpr std::int64_t kFewEvents = 100;  // of fewer nothing can be told
constexpr double kDay_s = 86'400;
/// What is shorter nobody records, and no pixel fires twice within the dead time.
constexpr double kShortest_s = 2e-3, kDeadTime_s = 10e-6;
/// Events of a pixel in a second: of a camera at rest, and more than any has.
constexpr double kLeastRate = 0.02, kMostRate = 500;

struct Unit {
  std::string_view word, name;
  int power;  ///< of ten: what it is in seconds
};
constexpr std::array kUnits{Unit{"ns", "nanoseconds", -9}, Unit{"us", "microseconds", -6},
                            Unit{"ms", "milliseconds", -3}, Unit{"s", "seconds", 0}};
enum : std::size_t { kNs, kUs, kMs, kS };

struct Times {
  double least = HUGE_VAL, most = -HUGE_VAL;
  int step = 6;       ///< the power of ten that all are multiples of: 6, 3, 0, -3, -6; -9: finer
  double pixels = 0;  ///< of the image that has all events
  std::int64_t width = 1;

  bool are_whole() const { return step >= 0; }
};

Times look_at(const CompactEvents& events) {
  Times times;
  double width = 1, height = 1;
  constexpr double kMostSide = 8192;
  for (std::int64_t i = 0; i < events.size(); ++i) {
    const StoredEvent event = events[i];
    if (event.x >= 0 && event.x < kMostSide) width = std::max(width, event.x + 1);
    if (event.y >= 0 && event.y < kMostSide) height = std::max(height, event.y + 1);
    const double time = event.t_s;
    if (!std::isfinite(time)) continue;
    times.least = std::min(times.least, time);
    times.most = std::max(times.most, time);
  }
  times.width = static_cast<std::int64_t>(width);
  times.pixels = width * height;
  const bool is_whole = times.least == std::floor(times.least);
  if (!is_whole) times.step = -3;
  double scale = is_whole ? 1e-6 : 1e3;
  const auto is_multiple = [&](double time) {
    // Whole ones count from the first: a clock may begin between two of its steps.
    const double steps = (times.step > 0 ? time - times.least : time) * scale;
    constexpr double kRounded = 4 * std::numeric_limits<double>::epsilon();
    return std::abs(steps - std::round(steps)) <= 1e-9 + kRounded * std::abs(steps);
  };
  for (const double time : events.times_s()) {
    for (; times.step > -9 && std::isfinite(time) && !is_multiple(time); scale *= 1e3) {
      times.step -= 3;
    }
  }
  return times;
}

/// After how many ticks one in twenty events at the latest follows another of its pixel.
double soonest_ticks(const CompactEvents& events, const Times& times) {
  constexpr std::int64_t kLooked = std::int64_t{1} << 22;
  constexpr std::size_t kFewGaps = 100;
  std::vector<double> last(static_cast<std::size_t>(times.pixels), -HUGE_VAL), gaps;
  for (std::int64_t i = 0; i < std::min(events.size(), kLooked); ++i) {
    const StoredEvent event = events[i];
    const double pixel = event.y * static_cast<double>(times.width) + event.x;
    if (!(pixel >= 0 && pixel < times.pixels) || !std::isfinite(event.t_s)) continue;
    double& before = last[static_cast<std::size_t>(pixel)];
    if (std::isfinite(before) && event.t_s >= before) gaps.push_back(event.t_s - before);
    before = event.t_s;
  }
  if (gaps.size() < kFewGaps) return HUGE_VAL;
  const auto place = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 20);
  std::nth_element(gaps.begin(), place, gaps.end());
  return *place;
}

/// The events if their times count a unit.
struct Reading {
  double tick_s = 1, span_s = 0;
  double rate = 0;             ///< events of a pixel in a second
  bool is_of_the_day = false;  ///< its times are of this century
  bool may_be = false, is_busy = false;
};

std::string number_text(double value) {
  if (value >= 1e6) return fmt::format("{:.3g} million", value / 1e6);
  return value >= 1e3 ? fmt::format("{:.3g} thousand", value / 1e3) : fmt::format("{:.3g}", value);
}

/// What a person can check.
std::string text_of(const Reading& reading, std::int64_t events) {
  const double rate = static_cast<double>(events) / reading.span_s;
  return fmt::format("{:g} s, {} events{}", reading.span_s, events,
                     std::isfinite(rate) ? fmt::format(", {} a second", number_text(rate)) : "");
}

std::array<Reading, kUnits.size()> readings_of(const Times& times, double events) {
  std::array<Reading, kUnits.size()> readings{};
  for (std::size_t i = 0; i < kUnits.size(); ++i) {
    constexpr double kBegin_s = 946'684'800, kEnd_s = 4'102'444'800, kLongestOn_s = 1e8;
    constexpr double kLeastPixels = 1000;
    Reading& reading = readings[i];
    reading.tick_s = std::pow(10, kUnits[i].power);
    reading.span_s = (times.most - times.least) * reading.tick_s;
    reading.rate = events / reading.span_s / std::max(times.pixels, kLeastPixels);
    const double end_s = times.most * reading.tick_s;
    reading.is_of_the_day = times.least * reading.tick_s >= kBegin_s && end_s < kEnd_s;
    reading.may_be = (reading.is_of_the_day || end_s < kLongestOn_s) &&
                     reading.span_s >= kShortest_s && reading.span_s <= kDay_s &&
                     reading.rate <= kMostRate;
    reading.is_busy = reading.may_be && reading.rate >= kLeastRate;
  }
  // Of whole ms a short recording of us may be made, whose rate says little.
  const double short_s = readings[kUs].span_s;
  const double events_per_tick = events / std::max(times.most - times.least, 1.0);
  readings[kMs].is_busy |= readings[kMs].may_be && times.are_whole() && short_s < 0.1 &&
                           events_per_tick >= (short_s < 0.02 ? 0.05 : 1);
  return readings;
}

}  // namespace

TimeUnit tell_time_unit(const CompactEvents& events, const std::string& file) {
  const Times times = look_at(events);
  if (times.most < times.least) return {};
  auto readings = readings_of(times, static_cast<double>(events.size()));
  const std::size_t usual = times.are_whole() ? kUs : kS;
  const auto taken = [&](std::size_t unit) {
    return TimeUnit{
        std::round(1 / readings[unit].tick_s),
        fmt::format("{}: {}", kUnits[unit].name, text_of(readings[unit], events.size()))};
  };
  const auto doubt = [&]() -> TimeUnit {
    std::vector<std::string> all;
    std::string_view one;
    const auto may_be = [](const Reading& reading) { return reading.may_be; };
    const bool has_some = std::ranges::count_if(readings, may_be) > 0;
    for (std::size_t i = 0; i < kUnits.size(); ++i) {
      if (has_some && !readings[i].may_be && i != usual) continue;
      all.push_back(fmt::format("{} ({})", kUnits[i].word, text_of(readings[i], events.size())));
      if (one.empty() || i == usual) one = kUnits[i].word;
    }
    throw InputError(fmt::format(
        "expected \"unit\" in \"columns\" in the manifest (\"columns\": {{\"unit\": \"{}\"}}), "
        "since the times may be {}, got none, in {}",
        one, fmt::join(all, " or "), file));
  };
  // As us they would be of the year 30,000 or later.
  if (readings[kNs].is_of_the_day) return taken(kNs);
  if (events.size() < kFewEvents) return readings[usual].span_s <= kDay_s ? taken(usual) : doubt();
  const auto finer = std::span(readings).first(usual);
  if (std::ranges::any_of(finer, &Reading::may_be)) {
    const double soonest = soonest_ticks(events, times);
    for (Reading& reading : finer) {
      if (soonest * reading.tick_s < kDeadTime_s) reading.may_be = reading.is_busy = false;
    }
  }
  std::vector<std::size_t> busy;
  for (std::size_t i = 0; i < kUnits.size(); ++i) {
    if (readings[i].is_busy) busy.push_back(i);
  }
  if (busy.size() > 1) {
    for (const std::size_t i : busy) {
      if (readings[i].is_of_the_day) return taken(i);
    }
    return doubt();
  }
  if (busy.empty()) {  // a quiet camera
    const bool may_be_finer = std::ranges::any_of(finer, &Reading::may_be);
    return readings[usual].may_be && !may_be_finer ? taken(usual) : doubt();
  }
  // One that is not usual needs a sign of it: its step is a microsecond, or the clock of the day.
  const std::size_t unit = busy[0];
  const bool is_a_us = times.step + kUnits[unit].power == -6;
  const bool is_quiet =
      times.are_whole() || !readings[usual].may_be || readings[usual].rate < kLeastRate / 20;
  const bool has_sign = (is_a_us && is_quiet) || readings[unit].is_of_the_day;
  return unit == usual || has_sign ? taken(unit) : doubt();
}

}  // namespace eventgan
