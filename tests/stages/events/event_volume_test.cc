#include "stages/events/event_volume.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr VolumeShape kShape{9, {4, 5}};

std::size_t index(int channel, int y, int x) {
  return static_cast<std::size_t>((channel * kShape.size.height + y) * kShape.size.width + x);
}

TEST(EventVolume, NoEventsAreZeros) {
  const auto volume = event_volume({}, kShape);
  EXPECT_EQ(volume.size(), 18u * 4 * 5);
  EXPECT_THAT(volume, ::testing::Each(0.0f));
}

TEST(EventVolume, OneEventFallsIntoTheFirstBin) {
  const Event event{2, 3, 17.0, true};
  const auto volume = event_volume({&event, 1}, kShape);
  EXPECT_FLOAT_EQ(volume[index(0, 3, 2)], 1.0f);
  EXPECT_FLOAT_EQ(std::accumulate(volume.begin(), volume.end(), 0.0f), 1.0f);
}

TEST(EventVolume, EventsAtOneTimeFallIntoTheFirstBin) {
  const std::vector<Event> events{{0, 0, 1.0, true}, {1, 0, 1.0, false}};
  const auto volume = event_volume(events, kShape);
  EXPECT_FLOAT_EQ(volume[index(0, 0, 0)], 1.0f);
  EXPECT_FLOAT_EQ(volume[index(9, 0, 1)], 1.0f);
}

TEST(EventVolume, TimeIsSharedLinearlyBetweenTheTwoNearestBins) {
  // t from 0 to 1: t* = 8 t, so t = 0.40625 lies at 3.25: 0.75 into bin 3 and 0.25 into bin 4.
  const std::vector<Event> events{{0, 0, 0.0, true}, {1, 1, 0.40625, false}, {0, 0, 1.0, true}};
  const auto volume = event_volume(events, kShape);
  EXPECT_FLOAT_EQ(volume[index(9 + 3, 1, 1)], 0.75f);
  EXPECT_FLOAT_EQ(volume[index(9 + 4, 1, 1)], 0.25f);
  EXPECT_FLOAT_EQ(volume[index(8, 0, 0)], 1.0f);
}

TEST(EventVolume, NoBinCountIndexesBeyondTheLastBinNorCountsBeyondFloat32) {
  // Times whose scaled value may round up past the last bin; the sum proves that no event is lost.
  for (int bins = 1; bins <= 64; ++bins) {
    const VolumeShape shape{bins, {1, 1}};
    std::vector<Event> events;
    for (int i = 0; i <= 30; ++i) events.push_back({0, 0, 1e9 + i * 0.1, i % 2 == 0});
    const auto volume = event_volume(events, shape);
    EXPECT_NEAR(std::accumulate(volume.begin(), volume.end(), 0.0), 31.0, 1e-4) << bins;
  }
  // 1 added to 2^24 is 2^24 in float32; 2^24 + 8 is a float32 again.
  const std::vector<Event> events((1 << 24) + 8, Event{0, 0, 0, true});
  EXPECT_EQ(event_volume(events, {1, {1, 1}})[0], float((1 << 24) + 8));
}

TEST(EventVolume, RefusesEventsOutsideOrOutOfTimeOrder) {
  for (const Event bad : {Event{5, 0, 0, true}, Event{-1, 0, 0, true}, Event{0, 4, 0, true},
                          Event{0, 0, std::numeric_limits<double>::quiet_NaN(), true}}) {
    EXPECT_THROWS(event_volume({&bad, 1}, kShape), std::invalid_argument,
                  "expected an event with a finite time inside 5x4 pixels");
  }
  EXPECT_THROWS(
      event_volume(std::vector<Event>{{0, 0, 1, true}, {0, 0, 0.5, true}, {0, 0, 2, true}}, kShape),
      std::invalid_argument, "expected events in time order, got t=0.500000 after");
  // 8 (t_N - t_1) of more than 1.8e308 would make t* = infinity / infinity.
  EXPECT_THROWS(event_volume(std::vector<Event>{{0, 0, -1e308, true}, {0, 0, 1e308, true}}, kShape),
                std::invalid_argument, "expected times whose differences are finite");
  const auto volume =
      event_volume(std::vector<Event>{{0, 0, 0, true}, {0, 0, 2e307, true}}, kShape);
  EXPECT_EQ(volume[index(8, 0, 0)], 1.0f);
}

TEST(EventVolume, AShortRecordingLateOnAClockKeepsItsTimes) {
  // At 1e9 s doubles are 2^-23 s = 0.12 us apart, so that steps of 1 us are off by 0.06 us at each
  // end: of the 0.8 ms between first and last event 8 (0.06 + 0.06) / 800 = 0.0012 bins.
  std::vector<Event> events;
  for (int i = 0; i <= 800; ++i) events.push_back({i % 5, 0, 1e9 + i * 1e-6, true});
  const auto late = event_volume(events, kShape);
  for (int i = 0; i <= 800; ++i) events[i].t_s = i * 1e-6;
  // 20 events of a pixel share a bin's triangle on either side.
  EXPECT_THAT(
      late, ::testing::Pointwise(::testing::FloatNear(40 * 0.0012f), event_volume(events, kShape)));
}

TEST(EventVolume, OfAPartOfTheEventsHasTheTimesOfAll) {
  const std::vector<Event> events{{0, 0, 2, true}, {0, 0, 4, true}};
  // t* = 2 (t - 1) / 4: 0.5 and 1.5.
  EXPECT_EQ(event_volume(events, {3, {1, 1}}, std::array{1.0, 5.0}),
            (std::vector<float>{0.5f, 1, 0.5f, 0, 0, 0}));
  EXPECT_EQ(event_volume(events, {3, {1, 1}}, std::array{2.0, 4.0}),
            event_volume(events, {3, {1, 1}}));
  EXPECT_EQ(event_volume({}, {3, {1, 1}}, std::array{2.0, 4.0}), std::vector<float>(6));
  for (const std::array<double, 2> times_s : {std::array{2.5, 5.0}, std::array{1.0, 3.0}}) {
    EXPECT_THROWS(event_volume(events, {3, {1, 1}}, times_s), std::invalid_argument,
                  "expected events from t=");
  }
}

TEST(PlacedEvents, ComeToThePixelThatTheirCentreFallsIn) {
  // 4x2 pixels stretched to 6x1: columns (x + 0.5) 1.5 = 0.75, 2.25, 3.75, 5.25; all rows to 0.
  std::vector<Event> events{{0, 0, 1, true}, {1, 1, 2, false}, {2, 0, 2, true}, {3, 1, 3, true}};
  place_events({{2, 4}, {1, 6}, {1, 6}, 0, 0}, events);
  EXPECT_EQ(events, (std::vector<Event>{
                        {0, 0, 1, true}, {2, 0, 2, false}, {3, 0, 2, true}, {5, 0, 3, true}}));
  std::vector<Event> letterboxed{{0, 0, 1, true}, {3, 1, 2, true}};
  place_events({{2, 4}, {2, 4}, {6, 4}, 0, 2}, letterboxed);  // two rows of border above
  EXPECT_EQ(letterboxed, (std::vector<Event>{{0, 2, 1, true}, {3, 3, 2, true}}));
  std::vector<Event> cut{{0, 0, 1, true}, {1, 0, 1, true}, {2, 1, 2, true}, {3, 1, 3, true}};
  place_events({{2, 4}, {2, 4}, {2, 2}, -1, 0}, cut);  // a column less on either side
  EXPECT_EQ(cut, (std::vector<Event>{{0, 0, 1, true}, {1, 1, 2, true}}));
  events = std::vector<Event>{{8191, 8191, 1, true}, {0, 0, 1, true}};
  place_events({{8192, 8192}, {8192, 8192}, {8192, 8192}, 0, 0}, events);
  EXPECT_EQ(events, (std::vector<Event>{{8191, 8191, 1, true}, {0, 0, 1, true}}));
}

TEST(EventVolume, EqualsThePublishedCode) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  for (const std::string& name : testing::member_names(golden, "events")) {
    const auto rows = testing::read_array(golden, "events/" + name + "/events_xytp");
    const auto expected = testing::read_array(golden, "events/" + name + "/volume");
    std::vector<Event> events;
    for (std::size_t i = 0; i < rows.shape[0]; ++i) {
      const float* row = rows.values.data() + 4 * i;
      events.push_back({int(row[0]), int(row[1]), row[2], row[3] > 0});
    }
    const VolumeShape shape{9, {int(expected.shape[1]), int(expected.shape[2])}};
    // The published code works in float32: sums of up to 1302 events differ in the sixth digit.
    EXPECT_THAT(event_volume(events, shape),
                ::testing::Pointwise(::testing::FloatNear(5e-5f), expected.values))
        << name;
  }
}

TEST(TimeImage, IsTheMeanTimeWeightedByTheVolume) {
  // 3 bins at 0.1, 0.55, 1; one pixel with 1 in the first and 3 in the last: (0.1 + 3) / 4 = 0.775.
  std::vector<float> volume{1, 0, 3, 0, 2, 0};
  TimeImage image = time_image(volume, {3, {1, 1}});
  EXPECT_NEAR(image.positive[0], 0.775f, 1e-5f);
  EXPECT_NEAR(image.negative[0], 0.55f, 1e-5f);
  volume = std::vector<float>(2 * 9 * 6, 0.0f);
  image = time_image(volume, {9, {2, 3}});
  EXPECT_EQ(image.positive.size(), 6u);
  EXPECT_THAT(image.positive, ::testing::Each(0.0f));
  EXPECT_THAT(image.negative, ::testing::Each(0.0f));
  volume = std::vector<float>{5, 0};
  EXPECT_NEAR(time_image(volume, {1, {1, 1}}).positive[0], 0.1f, 1e-6f);
}

TEST(TimeImage, EqualsThePublishedCode) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const auto volumes = testing::read_array(golden, "time_image/volume");
  const auto expected = testing::read_array(golden, "time_image/image");
  const VolumeShape shape{9, {int(volumes.shape[2]), int(volumes.shape[3])}};
  for (std::size_t sample = 0; sample < volumes.shape[0]; ++sample) {
    const std::span volume(volumes.values.data() + sample * shape.value_count(),
                           shape.value_count());
    const TimeImage image = time_image(volume, shape);
    for (std::size_t i = 0; i < shape.size.pixel_count(); ++i) {
      const float published = (image.positive[i] + image.negative[i]) / 2;
      ASSERT_NEAR(published, expected.values[sample * shape.size.pixel_count() + i], 1e-6f) << i;
    }
  }
}

}  // namespace
}  // namespace eventgan
