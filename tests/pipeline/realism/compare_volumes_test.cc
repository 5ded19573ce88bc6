#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "manifests/values/faults.h"
#include "pipeline/realism/real_interval.h"
#include "pipeline/realism/realism.h"
#include "stages/events/event_volume.h"
#include "stages/events/volume_statistics.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

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
  EXPECT_THROWS(choose_intervals(recording, 0, 3, {1}), UsageError,
                "--frames: expected FIRST:LAST in 0..2, got 0:3, in fake");
  EXPECT_THROWS(choose_intervals(recording, -1, 2, {1}), UsageError,
                "--frames: expected FIRST:LAST in 0..2, got -1:2, in fake");
  EXPECT_THROWS(choose_intervals(recording, 2, 1, {1}), UsageError,
                "--frames: expected FIRST:LAST in 0..2, got 2:1, in fake");
  EXPECT_THROWS(choose_intervals(recording, 1, 1, {1}), UsageError,
                "expected frames 1 apart, got frames 1:1, in fake recording");
  EXPECT_THROWS(choose_intervals(recording, 0, 2, {3}), UsageError,
                "expected frames 3 apart, got frames 0:2, in fake recording");
  EXPECT_THROWS(choose_intervals(recording, 0, 2, {}), UsageError,
                "--gaps: expected different numbers of frames, 1 or more");
  EXPECT_THROWS(choose_intervals(recording, 0, 2, {0}), UsageError,
                "--gaps: expected different numbers of frames, 1 or more");
  EXPECT_THROWS(choose_intervals(recording, 0, 2, {1, 1}), UsageError,
                "--gaps: expected different numbers of frames, 1 or more");
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
  const IntervalFrames frames{{0, 1}, 0.1, {{1, 2}, {0, 255}}, {{1, 2}, {51, 204}}, 0, 0};
  EXPECT_THAT(network_input(frames),
              ElementsAre(-1.0f, 1.0f, ::testing::FloatEq(-0.6f), ::testing::FloatEq(0.6f)));
}

constexpr ImageSize kSize{2, 5};

FlowField row_flow(const std::vector<float>& x_of_column, float y = 0) {
  FlowField flow{kSize, {}, std::vector<float>(kSize.pixel_count(), y)};
  for (int row = 0; row < kSize.height; ++row) {
    flow.x_px.insert(flow.x_px.end(), x_of_column.begin(), x_of_column.end());
  }
  return flow;
}

FakeRecording recording_of(const std::vector<FlowField>& flows, ImageSize size = kSize) {
  std::vector<double> times;
  for (std::size_t i = 0; i <= flows.size(); ++i) times.push_back(static_cast<double>(i));
  const GreyImage frame{size, std::vector<std::uint8_t>(size.pixel_count())};
  return {std::vector<GreyImage>(times.size(), frame), times, {}, flows};
}

TEST(FlowPath, OfOneIntervalIsItsFlow) {
  const auto recording = recording_of({row_flow({0, 1, 2, 3, 4}), row_flow({9, 9, 9, 9, 9})});
  const auto path = flow_path(recording, {0, 1});
  ASSERT_TRUE(path.has_value());
  EXPECT_EQ(path->x_px, row_flow({0, 1, 2, 3, 4}).x_px);
}

TEST(FlowPath, FollowsThePixel) {
  // From column 0 by 1.5 to 1.5, where the second flow is halfway between 10 and 20: 1.5 + 15.
  const auto recording =
      recording_of({row_flow({1.5f, 1, 2, 1, 0}), row_flow({0, 10, 20, 30, 40})});
  const auto path = flow_path(recording, {0, 2});
  ASSERT_TRUE(path.has_value());
  EXPECT_FLOAT_EQ(path->x_px[0], 16.5f);
  EXPECT_FLOAT_EQ(path->x_px[1], 1 + 20);
  EXPECT_FLOAT_EQ(path->x_px[2], 2 + 40);  // arrives on the last column
  EXPECT_FLOAT_EQ(path->x_px[3], 1 + 40);
  EXPECT_FLOAT_EQ(path->x_px[4], 40);
  EXPECT_FLOAT_EQ(path->y_px[0], 0);
}

TEST(FlowPath, AddsUpOverThreeIntervals) {
  const FlowField step = row_flow({1, 1, 1, 1, 1});
  const auto path = flow_path(recording_of({step, step, step}), {0, 3});
  ASSERT_TRUE(path.has_value());
  EXPECT_FLOAT_EQ(path->x_px[0], 3);
  EXPECT_FLOAT_EQ(path->x_px[2], 3);
}

TEST(FlowPath, IsUnknownBeyondTheImageAndWhereTheFlowIs) {
  const float unknown = std::numeric_limits<float>::quiet_NaN();
  const auto recording =
      recording_of({row_flow({0, 0, 0, 0, 0.5f}), row_flow({unknown, 1, 1, 1, 1})});
  const auto path = flow_path(recording, {0, 2});
  ASSERT_TRUE(path.has_value());
  EXPECT_TRUE(std::isnan(path->x_px[0]));
  EXPECT_FLOAT_EQ(path->x_px[1], 1);
  EXPECT_TRUE(std::isnan(path->x_px[4]));
  const auto down =
      flow_path(recording_of({row_flow({0, 0, 0, 0, 0}, 1), row_flow({0, 0, 0, 0, 0})}), {0, 2});
  EXPECT_FLOAT_EQ(down->y_px[0], 1);
  EXPECT_TRUE(std::isnan(down->y_px[5]));
}

TEST(FlowPath, OfAnImageOfOnePixelAndNoneWithoutFlows) {
  const FlowField still{{1, 1}, {0}, {0}};
  const auto path = flow_path(recording_of({still, still}, {1, 1}), {0, 2});
  ASSERT_TRUE(path.has_value());
  EXPECT_EQ(path->x_px[0], 0);
  const GreyImage frame{{1, 1}, {0}};
  const FakeRecording recording({frame, frame}, {0, 1}, {});
  EXPECT_FALSE(flow_path(recording, {0, 1}).has_value());
}

constexpr int kBins = 3;

/// A method whose volumes are a function of the interval and the draw.
class FunctionMethod final : public VolumeMethod {
 public:
  using Function = std::function<std::vector<float>(const IntervalFrames&, int)>;
  FunctionMethod(std::string name, int draws, Function function)
      : name_(std::move(name)), draws_(draws), function_(std::move(function)) {}

  std::string name() const override { return name_; }
  std::string settings() const override { return "none"; }
  int draws() const override { return draws_; }
  std::vector<float> volume(const IntervalFrames& frames, int draw) const override {
    return function_(frames, draw);
  }

 private:
  std::string name_;
  int draws_;
  Function function_;
};

/// The camera's own volume on even draws, nothing on odd ones.
std::vector<std::unique_ptr<VolumeMethod>> perfect_method(const FakeRecording& recording,
                                                          int draws) {
  std::vector<std::unique_ptr<VolumeMethod>> methods;
  methods.push_back(std::make_unique<FunctionMethod>(
      "perfect", draws, [&](const IntervalFrames& frames, int draw) {
        const auto events = recording.events_between(frames.interval.first, frames.interval.last);
        const std::size_t used = draw % 2 == 0 ? events.size() : 0;
        return normalized(event_volume(std::span(events).first(used), {kBins, recording.size()}));
      }));
  return methods;
}

ComparisonRun run_on(int threads) {
  ComparisonRun run;
  run.bins = kBins;
  run.threads = threads;
  return run;
}

TEST(CompareVolumes, TheCamerasOwnVolumeIsPerfect) {
  const FakeRecording recording = moving_bar_recording({12, 16}, 4);
  const std::vector<FrameInterval> intervals{{0, 1}, {1, 3}};
  const auto methods = perfect_method(recording, 1);
  const RealismReport report = compare_volumes(recording, intervals, methods, run_on(1));
  ASSERT_EQ(report.methods.size(), 1u);
  EXPECT_EQ(report.methods[0].mean.f1_raw, 1);
  EXPECT_EQ(report.methods[0].mean.pool_mse_2, 0);
  EXPECT_EQ(report.methods[0].mean.events_per_pixel, report.real.mean.events_per_pixel);
  ASSERT_EQ(report.methods[0].intervals.size(), 2u);
  ASSERT_TRUE(report.real.direction && report.methods[0].direction);
  EXPECT_EQ(report.real.direction->pixels, report.methods[0].direction->pixels);
  EXPECT_EQ(report.intervals[1].interval, (FrameInterval{1, 3}));
  EXPECT_EQ(report.intervals[1].event_count,
            static_cast<std::int64_t>(recording.events_between(1, 3).size()));
  EXPECT_EQ(report.size, recording.size());
}

TEST(CompareVolumes, ScoresAreMeansOverTheDraws) {
  const FakeRecording recording = moving_bar_recording({12, 16}, 2);
  const std::vector<FrameInterval> intervals{{0, 1}};
  const auto methods = perfect_method(recording, 4);
  const RealismReport report = compare_volumes(recording, intervals, methods, run_on(1));
  EXPECT_DOUBLE_EQ(report.methods[0].mean.f1_raw, 0.5);
  EXPECT_DOUBLE_EQ(report.methods[0].mean.events_per_pixel, report.real.mean.events_per_pixel / 2);
}

TEST(CompareVolumes, ThreadsDoNotChangeIt) {
  const FakeRecording recording = moving_bar_recording({12, 16}, 12);
  const auto intervals = choose_intervals(recording, 0, std::nullopt, {1, 2, 3});
  const auto methods = perfect_method(recording, 2);
  ComparisonRun parallel = run_on(4);
  int told = 0;
  parallel.on_interval = [&] { ++told; };
  const auto json = [&](const ComparisonRun& run) {
    return to_json(std::vector{compare_volumes(recording, intervals, methods, run)});
  };
  EXPECT_EQ(json(run_on(1)), json(parallel));
  EXPECT_EQ(told, static_cast<int>(intervals.size()));
}

TEST(CompareVolumes, AnUnsoundVolumeIsToldWithItsMethodAndFrames) {
  FakeRecording recording = moving_bar_recording({4, 8}, 3);
  recording.set_name("rec");
  std::vector<std::unique_ptr<VolumeMethod>> methods;
  methods.push_back(std::make_unique<FunctionMethod>("broken", 1, [](const IntervalFrames&, int) {
    return std::vector<float>(2 * kBins * 32, std::numeric_limits<float>::quiet_NaN());
  }));
  const std::vector<FrameInterval> intervals{{1, 2}};
  try {
    compare_volumes(recording, intervals, methods, run_on(2));
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("\"broken\""),
                                               ::testing::HasSubstr("1 and 2 of rec")));
  }
}

TEST(CompareVolumes, DrawsAnImageOfEachInterval) {
  const testing::TemporaryFolder folder;
  const FakeRecording recording = moving_bar_recording({12, 16}, 3);
  const std::vector<FrameInterval> intervals{{0, 1}, {0, 2}};
  const auto methods = perfect_method(recording, 2);
  ComparisonRun run = run_on(1);
  run.images = folder.path();
  compare_volumes(recording, intervals, methods, run);
  EXPECT_TRUE(std::filesystem::exists(folder / "000000-000001.png"));
  EXPECT_TRUE(std::filesystem::exists(folder / "000000-000002.png"));
}

}  // namespace
}  // namespace eventgan
