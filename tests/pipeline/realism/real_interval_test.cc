#include "pipeline/realism/real_interval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "manifests/faults.h"
#include "stages/events/event_volume.h"
#include "stages/events/normalization.h"
#include "tests/testing/fake_recording.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using testing::FakeRecording;
using testing::moving_bar_recording;
using ::testing::SizeIs;

FakeRecording recording_of(int frames) { return moving_bar_recording({4, 8}, frames); }

TEST(ChooseIntervals, TakesPairsByGapWithBothFramesInside) {
  const FakeRecording recording = recording_of(6);
  EXPECT_THAT(choose_intervals(recording, 1, 4, {2, 1}),
              ElementsAre(FrameInterval{1, 3}, FrameInterval{2, 4}, FrameInterval{1, 2},
                          FrameInterval{2, 3}, FrameInterval{3, 4}));
  EXPECT_THAT(choose_intervals(recording, 0, std::nullopt, {5}), ElementsAre(FrameInterval{0, 5}));
  EXPECT_THAT(choose_intervals(recording, 0, std::nullopt, {1}), SizeIs(5));
}

TEST(ChooseIntervals, RefusesWhatHasNoPairs) {
  const FakeRecording recording = recording_of(3);
  EXPECT_THROW(choose_intervals(recording, 0, 3, {1}), UsageError);
  EXPECT_THROW(choose_intervals(recording, -1, 2, {1}), UsageError);
  EXPECT_THROW(choose_intervals(recording, 2, 1, {1}), UsageError);
  EXPECT_THROW(choose_intervals(recording, 1, 1, {1}), UsageError);
  EXPECT_THROW(choose_intervals(recording, 0, 2, {3}), UsageError);
  EXPECT_THROW(choose_intervals(recording, 0, 2, {}), UsageError);
  EXPECT_THROW(choose_intervals(recording, 0, 2, {0}), UsageError);
  EXPECT_THROW(choose_intervals(recording, 0, 2, {1, 1}), UsageError);
}

TEST(ReadInterval, HasTheIntervalsFramesEventsAndFlow) {
  const FakeRecording recording = recording_of(4);
  const RealInterval real = read_interval(recording, {1, 3}, 5);
  EXPECT_EQ(real.frames.previous, recording.frame(1));
  EXPECT_EQ(real.frames.next, recording.frame(3));
  EXPECT_NEAR(real.frames.duration_s, 0.1, 1e-12);
  const auto events = recording.events_between(1, 3);
  EXPECT_EQ(real.frames.event_count, static_cast<std::int64_t>(events.size()));
  const std::vector<float> counts = event_volume(events, {5, recording.size()});
  EXPECT_NEAR(std::accumulate(counts.begin(), counts.end(), 0.0),
              static_cast<double>(events.size()), 1e-4);
  EXPECT_THAT(real.volume, SizeIs(2 * 5 * 4 * 8));
  EXPECT_EQ(real.volume, normalized(counts));
  ASSERT_TRUE(real.flow.has_value());
  EXPECT_EQ(real.flow->x_px.front(), 4);  // two steps of 2 px
  EXPECT_EQ(read_frames(recording, {1, 3}).event_count, real.frames.event_count);
}

TEST(NetworkInput, IsBothFramesInMinusOneToOne) {
  const IntervalFrames frames{{0, 1}, 0.1, {{1, 2}, {0, 255}}, {{1, 2}, {51, 204}}, 0};
  EXPECT_THAT(network_input(frames),
              ElementsAre(-1.0f, 1.0f, ::testing::FloatEq(-0.6f), ::testing::FloatEq(0.6f)));
}

}  // namespace
}  // namespace eventgan
