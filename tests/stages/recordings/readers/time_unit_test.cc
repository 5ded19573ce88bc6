#include "stages/recordings/readers/detail/time_unit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// What a table is made of: so many events of a sensor in so many seconds, at random, their times
/// in ticks rounded to a step of these; 0: not rounded.
struct Table {
  double tick_s, step_ticks;
  double events_per_s, span_s;
  ImageSize sensor = {260, 346};
  double begin_s = 0;
  double next_s = 0;  ///< half of the events are followed by another of their pixel after so long
};

CompactEvents events_of(const Table& table) {
  std::mt19937_64 random(7);
  const auto uniform = [&](double end) { return std::uniform_real_distribution(0.0, end)(random); };
  const auto count = static_cast<int>(table.events_per_s * table.span_s);
  std::vector<StoredEvent> events;
  while (std::ssize(events) < count) {
    StoredEvent event{std::floor(uniform(table.sensor.width)),
                      std::floor(uniform(table.sensor.height)), uniform(table.span_s), 1};
    events.push_back(event);
    if (table.next_s == 0) continue;
    event.t_s = std::min(event.t_s + table.next_s * (0.9 + uniform(0.2)), table.span_s);
    events.push_back(event);
  }
  CompactEvents stored;
  std::ranges::sort(events, {}, &StoredEvent::t_s);
  events.front().t_s = 0;
  events.back().t_s = table.span_s;
  for (StoredEvent& event : events) {
    const double ticks = (event.t_s + table.begin_s) / table.tick_s;
    event.t_s =
        table.step_ticks == 0
            ? ticks
            : std::round(std::round(ticks / table.step_ticks) * table.step_ticks * 1e6) / 1e6;
    stored.push_back(event);
  }
  return stored;
}

/// The tick that is taken, in seconds; 0: it is asked for.
double taken_s(const Table& table) try {
  return 1 / tell_time_unit(events_of(table), "a.npy").ticks_per_s;
} catch (const InputError&) {
  return 0;
}

constexpr double kS = 1, kMs = 1e-3, kUs = 1e-6, kNs = 1e-9;

TEST(TimeUnit, IsTheTrueOneOrAskedFor) {
  int told = 0, all = 0;
  for (const auto& [tick_s, step] : {std::pair(kS, 1e-6),
                                     {kS, 0.0},
                                     {kMs, 1e-3},
                                     {kMs, 0.0},
                                     {kMs, 1.0},
                                     {kUs, 1.0},
                                     {kUs, 0.0},
                                     {kNs, 1.0},
                                     {kNs, 1000.0},
                                     {kNs, 0.0},
                                     {kS, 1.0}}) {
    for (const double rate : {1e2, 1e3, 1e4, 3e4, 1e5, 3e5, 1e6, 1e7}) {
      for (const double span_s : {0.01, 0.04, 0.1, 0.33, 1.0, 8.0, 60.0, 600.0}) {
        for (const ImageSize sensor : {ImageSize{128, 128}, {260, 346}, {720, 1280}}) {
          if (rate * span_s < 100 || rate * span_s > 3e4) continue;
          if (rate / static_cast<double>(sensor.pixel_count()) > 500) continue;  // no camera has it
          // Of whole ms or s there are many in a recording, and more events than these.
          if (step * tick_s >= kMs && (step * tick_s * 1000 > span_s || rate < 1e3)) continue;
          const double taken = taken_s({tick_s, step, rate, span_s, sensor});
          ++all;
          told += taken != 0;
          if (taken == 0) continue;
          EXPECT_NEAR(taken / tick_s, 1, 1e-6)
              << tick_s << " s in steps of " << step << ", " << rate << " a second for " << span_s
              << " s, " << sensor.width << "x" << sensor.height;
        }
      }
    }
  }
  EXPECT_GT(3 * told, all);
}

TEST(TimeUnit, IsTakenWhereNoOtherMayBe) {
  const struct {
    const char* what;
    Table table;
  } cases[] = {
      {"N-CARS", {kUs, 1, 40'000, 0.1, {100, 120}}},
      {"PEDRo's windows", {kUs, 1, 4e5, 0.04}},
      {"a camera at rest, whose edges make events soon after each other",
       {kUs, 1, 5'000, 20, {260, 346}, 0, 3e-3}},
      {"the same in seconds", {kS, 1e-6, 5'000, 20, {260, 346}, 0, 3e-3}},
      {"a quiet one", {kS, 1e-6, 500, 60, {260, 346}, 0, 3e-3}},
      {"a second of a few events", {kUs, 1, 300, 1}},
      {"DV's clock of the day", {kUs, 1, 300, 1, {260, 346}, 1.6e9}},
      {"rpg_vid2e's pairs", {kNs, 1000, 50'000, 0.04, {180, 240}}},
      {"a part of them", {kNs, 1000, 336'000, 0.0595, {180, 240}}},
      {"ROS's clock of the day", {kNs, 1, 1'000, 8, {260, 346}, 1.6e9}},
      {"seconds of the day", {kS, 0, 50'000, 1, {260, 346}, 1.6e9}},
      {"seconds", {kS, 0, 100'000, 1}},
      {"a counter of milliseconds with decimals", {kMs, 1e-3, 4'500, 0.33, {260, 346}, 324'572}},
  };
  for (const auto& [what, table] : cases) {
    EXPECT_NEAR(taken_s(table) / table.tick_s, 1, 1e-6) << what;
  }
}

TEST(TimeUnit, IsAskedForWithAllThatMayBe) {
  const struct {
    const char* what;
    Table table;
    std::string text;
  } cases[] = {
      {"EV-UAV's clock",
       {kMs, 1, 12'500, 8},
       "us (0.008 s, 100000 events, 12.5 million a second) or ms (8 s, "},
      {"rpg_vid2e's, each ns",
       {kNs, 1, 50'000, 0.04, {180, 240}},
       "or us (40 s, 2000 events, 50 a second)"},
      {"at random, as a camera at rest",
       {kUs, 1, 5'000, 20},
       "ns (0.02 s, 100000 events, 5 million"},
      {"whole seconds", {kS, 1, 1'000, 60}, "or s (60 s, "},
      {"more than a day", {kUs, 1, 0.5, 100'000}, "us (100000 s, 50000 events, 0.5 a second)"}};
  for (const auto& [what, table, text] : cases) {
    EXPECT_THROWS(tell_time_unit(events_of(table), "a.npy"), InputError,
                  "expected \"unit\" in \"columns\" in the manifest", text)
        << what;
  }
}

TEST(TimeUnit, OfFewEventsIsTheUsual) {
  const auto of = [](const std::vector<double>& times) {
    CompactEvents events;
    for (const double time : times) events.push_back({0, 0, time, 1});
    return tell_time_unit(events, "a.npy");
  };
  EXPECT_EQ(of({0, 2'000'000}).ticks_per_s, 1e6);
  EXPECT_EQ(of({0, 2'000'000}).found, "microseconds: 2 s, 2 events, 1 a second");
  EXPECT_EQ(of({0, 0.25, 2}).found, "seconds: 2 s, 3 events, 1.5 a second");
  EXPECT_EQ(of({1.7e18, 1.7e18 + 2e9}).found, "nanoseconds: 2 s, 2 events, 1 a second");
  EXPECT_EQ(of({5}).found, "microseconds: 0 s, 1 events");
  EXPECT_EQ(of({}).found, "");
  EXPECT_THROWS(of({0, 3e11}), InputError, "us (300000 s, 2 events, ", "ns (300 s, ");
  EXPECT_THROWS(of({0.5, 3e8}), InputError, "us (300 s, 2 events, ", "s (3e+08 s, ");
}

}  // namespace
}  // namespace eventgan
