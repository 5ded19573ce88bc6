#include "pipeline/realism/compare_volumes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "stages/events/event_volume.h"
#include "stages/events/normalization.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::FakeRecording;
using testing::moving_bar_recording;

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
  EXPECT_EQ(to_json(compare_volumes(recording, intervals, methods, run_on(1))),
            to_json(compare_volumes(recording, intervals, methods, parallel)));
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

TEST(CompareVolumes, DrawsAPictureOfEachInterval) {
  const testing::TemporaryFolder folder;
  const FakeRecording recording = moving_bar_recording({12, 16}, 3);
  const std::vector<FrameInterval> intervals{{0, 1}, {0, 2}};
  const auto methods = perfect_method(recording, 2);
  ComparisonRun run = run_on(1);
  run.pictures = folder.path();
  compare_volumes(recording, intervals, methods, run);
  EXPECT_TRUE(std::filesystem::exists(folder / "000000-000001.png"));
  EXPECT_TRUE(std::filesystem::exists(folder / "000000-000002.png"));
}

}  // namespace
}  // namespace eventgan
