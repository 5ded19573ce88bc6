#include "stages/events/representation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

#include "manifests/values/faults.h"
#include "stages/events/event_volume.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

constexpr ImageSize kImage{2, 3};

std::vector<std::byte> bytes_of(const std::vector<Event>& events, const std::string& word,
                                ImageSize size = kImage,
                                std::optional<std::array<double, 2>> times_s = std::nullopt) {
  const Representation representation = parse_representation(word);
  std::vector<std::byte> values(static_cast<std::size_t>(std::max(channels_of(representation), 1)) *
                                    size.pixel_count() * number_bytes(representation),
                                std::byte{7});
  represent(events, representation, size, times_s, values);
  return values;
}

/// The values of both types as numbers.
std::vector<double> values_of(const std::vector<Event>& events, const std::string& word,
                              ImageSize size = kImage,
                              std::optional<std::array<double, 2>> times_s = std::nullopt) {
  const std::vector<std::byte> bytes = bytes_of(events, word, size, times_s);
  std::vector<double> values;
  if (number_bytes(parse_representation(word)) == 1) {
    for (const std::byte value : bytes) values.push_back(std::to_integer<int>(value));
    return values;
  }
  for (std::size_t i = 0; i < bytes.size(); i += sizeof(float)) {
    float value = 0;
    std::memcpy(&value, bytes.data() + i, sizeof(value));
    values.push_back(value);
  }
  return values;
}

std::string of_number(const RepresentationRow& row) {
  return std::string(row.word) + (row.number.empty() ? "" : ":3");
}

TEST(Representations, AreParsedWithTheirNumbersAndNoOthers) {
  using enum RepresentationKind;
  EXPECT_EQ(parse_representation("histogram:10"), (Representation{kHistogram, 10}));
  EXPECT_EQ(parse_representation("time_surface:0.03"), (Representation{kTimeSurface, 0.03}));
  EXPECT_EQ(parse_representation("count"), (Representation{kCount, 0}));
  EXPECT_EQ(parse_representation("eros:49"), (Representation{kEros, 49}));
  const struct {
    const char* text;
    const char* message;
  } cases[] = {
      {"histogramm:10",
       "expected a representation of volume:B, voxel:B, voxel_normalized:B, histogram:T, count, "
       "time_surface:TAU, eros:K, got \"histogramm:10\""},
      {"", "expected a representation of volume:B"},
      {"histogram", "expected histogram:T, T from 1 to 64, got \"histogram\""},
      {"histogram:", "expected histogram:T"},
      {"histogram:0", "expected histogram:T"},
      {"histogram:65", "expected histogram:T"},
      {"histogram:2.5", "expected histogram:T"},
      {"histogram:10:cut", "expected histogram:T"},
      {"histogram:nan", "expected histogram:T"},
      {"eros:50", "expected eros:K, K from 1 to 49"},
      {"time_surface:0", "expected time_surface:TAU, TAU from 1e-06 to 1e+06"},
      {"count:2", "expected count without a number"},
  };
  for (const auto& [text, message] : cases) {
    EXPECT_THAT([&] { parse_representation(text); },
                ::testing::ThrowsMessage<UsageError>(::testing::HasSubstr(message)));
  }
}

TEST(Representations, AreZerosWithoutEventsAndRefuseWhatIsNoEvent) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::pair<std::vector<Event>, const char*> unsound[] = {
      {{{3, 0, 0, true}}, "inside 3x2 pixels, got x=3 y=0"},
      {{{0, -1, 0, true}}, "inside 3x2 pixels, got x=0 y=-1"},
      {{{0, 0, nan, true}}, "expected an event with a finite time"},
      {{{0, 0, -1e308, true}, {0, 0, 1e308, true}}, "expected times whose differences are finite"},
      {{{0, 0, 1, true}, {0, 0, 0.5, true}}, "expected events in time order"}};
  for (const RepresentationRow& row : representations()) {
    EXPECT_THAT(values_of({}, of_number(row)), Each(0)) << row.word;
    for (const auto& [events, why] : unsound) {
      EXPECT_THROWS(values_of(events, of_number(row)), std::invalid_argument, why) << row.word;
    }
    const std::vector<Event> late{{0, 0, 2, true}};
    EXPECT_THROWS(values_of(late, of_number(row), kImage, {{0, 1}}), std::invalid_argument,
                  "expected events from t=0");
    std::array<std::byte, 1> small{};
    EXPECT_THROWS(represent({}, parse_representation(of_number(row)), kImage, {}, small),
                  std::invalid_argument, "expected room for", "bytes, got 1");
  }
}

TEST(Representations, OfOneEventAreAsTheirEquations) {
  // 2 x 1 pixels, one negative event on the right one, at t1 = tN.
  const std::vector<Event> one{{1, 0, 5, false}};
  constexpr ImageSize kSize{1, 2};
  EXPECT_THAT(values_of(one, "volume:2", kSize), ElementsAre(0, 0, 0, 0, 0, 1, 0, 0));
  EXPECT_THAT(values_of(one, "voxel:2", kSize), ElementsAre(0, -1, 0, 0));
  EXPECT_THAT(values_of(one, "voxel_normalized:2", kSize), ElementsAre(0, 0, 0, 0));
  EXPECT_THAT(values_of(one, "histogram:2", kSize), ElementsAre(0, 1, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(values_of(one, "count", kSize), ElementsAre(0, 0, 0, 1));
  EXPECT_THAT(values_of(one, "time_surface:1", kSize), ElementsAre(0, 0, 0, 1));
  EXPECT_THAT(values_of(one, "eros:3", kSize), ElementsAre(0, 255));
}

TEST(Representations, OfAnIntervalThatHasNoInverseAreFinite) {
  const std::vector<Event> events{{0, 0, 0, true}, {0, 0, 5e-324, true}};
  for (const RepresentationRow& row : representations()) {
    EXPECT_THAT(values_of(events, of_number(row), {1, 1}), Each(::testing::Le(255))) << row.word;
  }
}

TEST(Representations, OfSomeEventsAreAsTheirEquations) {
  // One pixel; t* of voxel:3 is 2 t, of t from 0 to 1.
  const std::vector<Event> events{{0, 0, 0, true}, {0, 0, 0.25, false}, {0, 0, 0.75, true}};
  constexpr ImageSize kSize{1, 1};
  constexpr std::array<double, 2> kTimes{0, 1};
  EXPECT_THAT(values_of(events, "voxel:3", kSize, kTimes), ElementsAre(0.5, 0, 0.5));
  EXPECT_THAT(values_of(events, "histogram:4", kSize, kTimes), ElementsAre(0, 1, 0, 0, 1, 0, 0, 1));
  EXPECT_THAT(values_of(events, "count", kSize, kTimes), ElementsAre(2, 1));
  const std::vector<double> surface = values_of(events, "time_surface:0.5", kSize, kTimes);
  EXPECT_NEAR(surface[0], std::exp(-0.25 / 0.5), 1e-7);
  EXPECT_NEAR(surface[1], std::exp(-0.75 / 0.5), 1e-7);
}

TEST(Representations, OfVoxelsArePositiveMinusNegativeBinsOfAVolume) {
  std::mt19937 random(3);
  std::vector<Event> events(5000);
  for (Event& event : events) {
    event = {static_cast<int>(random() % 7), static_cast<int>(random() % 5),
             1e3 + 0.05 * random() / 0xffffffff, random() % 3 == 0};
  }
  std::ranges::sort(events, {}, &Event::t_s);
  constexpr ImageSize kSize{5, 7};
  const std::vector<float> volume = event_volume(events, {4, kSize});
  const std::vector<double> voxels = values_of(events, "voxel:4", kSize);
  double sum = 0, squares = 0;
  const std::vector<double> normalized = values_of(events, "voxel_normalized:4", kSize);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    EXPECT_NEAR(voxels[i], volume[i] - volume[voxels.size() + i], 1e-4);
    sum += normalized[i];
    squares += normalized[i] * normalized[i];
  }
  EXPECT_NEAR(sum, 0, 1e-4);
  EXPECT_NEAR(squares / static_cast<double>(voxels.size()), 1, 1e-4);
}

TEST(Representations, OfVoxelsThatOnlyRoundingTellsApartAreTheMean) {
  // Of each pixel one event as long after the begin as another is before the end: 1 in both bins,
  // but for rounding, which must not become values of 1.
  std::vector<Event> events;
  constexpr ImageSize kSize{1, 400};
  for (int x = 0; x < kSize.width; ++x) {
    const double share = (x + 1) / 1000.0;
    events.push_back({x, 0, share, true});
    events.push_back({x, 0, 1 - share, true});
  }
  std::ranges::sort(events, {}, &Event::t_s);
  const auto [least, most] = std::ranges::minmax(values_of(events, "voxel:2", kSize, {{0, 1}}));
  EXPECT_LT(least, most);
  EXPECT_THAT(values_of(events, "voxel_normalized:2", kSize, {{0, 1}}),
              Each(::testing::DoubleNear(0, 1e-6)));
}

TEST(Representations, OfHistogramsAreCutAtTen) {
  std::vector<Event> events(300, {0, 0, 0, true});
  events.resize(305, {0, 0, 0, false});
  EXPECT_THAT(values_of(events, "histogram:1", {1, 1}), ElementsAre(5, 10));
}

TEST(Representations, OfHistogramsTakeMicrosecondsAsWholeNumbersDo) {
  // k fifths of the interval begin bin k of 5 on any clock, though 0.01 s has no double.
  for (const double clock_s : {0.0, 12.3456, 98765.4321}) {
    std::vector<Event> events;
    for (int k = 0; k <= 5; ++k) events.push_back({0, 0, clock_s + 0.01 * k, true});
    EXPECT_THAT(values_of(events, "histogram:5", {1, 1}), ElementsAre(0, 0, 0, 0, 0, 1, 1, 1, 1, 2))
        << clock_s;
  }
}

TEST(ErosSurface, IsTheProductOfItsDecays) {
  // By its definition, in double, with a border.
  constexpr ImageSize kSize{9, 12};
  for (const int kernel : {1, 2, 5, 8, 49}) {
    const int odd = kernel | 1, half = odd / 2;
    std::vector<double> expected(kSize.pixel_count());
    ErosSurface surface(kSize, kernel);
    std::mt19937 random(5);
    for (int i = 0; i < 400; ++i) {
      const Event event{static_cast<int>(random() % 12), static_cast<int>(random() % 9), 0, true};
      for (int y = 0; y < kSize.height; ++y) {
        for (int x = 0; x < kSize.width; ++x) {
          double& value = expected[static_cast<std::size_t>(y * kSize.width + x)];
          if (std::abs(y - event.y) <= half && std::abs(x - event.x) <= half) {
            value *= std::pow(0.3, 1.0 / odd);
          }
          if (y == event.y && x == event.x) value = 255;
        }
      }
      surface.add({&event, 1});
    }
    std::vector<std::uint8_t> image(kSize.pixel_count());
    surface.write(image);
    for (std::size_t i = 0; i < image.size(); ++i) {
      EXPECT_NEAR(image[i], expected[i], 0.5001) << kernel << ", pixel " << i;
    }
  }
}

TEST(ErosSurface, RefusesEventsOutside) {
  ErosSurface surface(kImage, 3);
  const Event outside{3, 0, 0, true};
  EXPECT_THAT(
      [&] {
        surface.add({&outside, 1});
      },
      ::testing::ThrowsMessage<std::invalid_argument>(
          "expected an event inside 3x2 pixels, got x=3 y=0"));
}

}  // namespace
}  // namespace eventgan
