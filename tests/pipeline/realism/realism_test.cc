#include "pipeline/realism/realism.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "manifests/faults.h"
#include "stages/recordings/open_recording.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::FakeRecording;
using ::testing::HasSubstr;
using testing::moving_bar_recording;

RealismOptions models_only() {
  RealismOptions options;
  options.methods = {RealismMethod::kDifference, RealismMethod::kEsim};
  options.threads = 2;
  return options;
}

TEST(MeasureRealism, ComparesTheModelsWithFittedThresholds) {
  const FakeRecording recording = moving_bar_recording({24, 32}, 6);
  const RealismReport report = measure_realism(recording, models_only());
  ASSERT_EQ(report.methods.size(), 2u);
  EXPECT_EQ(report.intervals.size(), 5u);
  EXPECT_EQ(report.bins, 9);
  // The bar's pixels have one event each, where the frames differ: with a threshold so high that
  // the difference has one too it finds exactly those.
  EXPECT_EQ(report.methods[0].name, "difference");
  EXPECT_THAT(report.methods[0].settings, HasSubstr("fitted"));
  EXPECT_GT(report.methods[0].mean.f1_time, 0.95);
  EXPECT_LT(report.methods[1].mean.f1_time, report.methods[0].mean.f1_time);
  EXPECT_TRUE(report.real.direction.has_value());
}

TEST(MeasureRealism, TakesTheThresholdItIsTold) {
  RealismOptions options = models_only();
  options.threshold = 0.5;
  const RealismReport report = measure_realism(moving_bar_recording({12, 16}, 3), options);
  EXPECT_EQ(report.methods[0].settings, "contrast threshold 0.5 of ln(u/255 + 0.02)");
}

TEST(MeasureRealism, SameSeedSameReport) {
  const FakeRecording recording = moving_bar_recording({24, 32}, 4);
  RealismOptions options = models_only();
  options.methods = {RealismMethod::kEsim};
  const auto scores = [&](std::uint64_t seed, int threads) {
    options.seed = seed;
    options.threads = threads;
    RealismReport report = measure_realism(recording, options);
    report.wall_seconds = 0;
    report.seed = 0;
    return to_json(report);
  };
  EXPECT_EQ(scores(1, 1), scores(1, 3));
  EXPECT_NE(scores(1, 1), scores(2, 1));
}

TEST(MeasureRealism, MakesThePicturesFolder) {
  const testing::TemporaryFolder folder;
  RealismOptions options = models_only();
  options.pictures = folder / "new/pictures";
  options.last_frame = 1;
  measure_realism(moving_bar_recording({12, 16}, 3), options);
  EXPECT_TRUE(std::filesystem::exists(options.pictures / "000000-000001.png"));
}

TEST(MeasureRealism, RefusesOptionsThatCannotBe) {
  const FakeRecording recording = moving_bar_recording({12, 16}, 3);
  RealismOptions none = models_only();
  none.methods = {};
  EXPECT_THROW(measure_realism(recording, none), UsageError);
  RealismOptions twice = models_only();
  twice.methods = {RealismMethod::kEsim, RealismMethod::kEsim};
  EXPECT_THROW(measure_realism(recording, twice), UsageError);
  for (const double threshold : {0.0, -1.0, 6.0, std::numeric_limits<double>::quiet_NaN()}) {
    RealismOptions options = models_only();
    options.threshold = threshold;
    EXPECT_THROW(measure_realism(recording, options), UsageError) << threshold;
  }
  for (const double number : {0.0, -1.0, 200.0, std::numeric_limits<double>::quiet_NaN()}) {
    RealismOptions options = models_only();
    options.log_epsilon = number;
    EXPECT_THROW(measure_realism(recording, options), UsageError) << number;
    options = models_only();
    options.esim_displacement_px = number;
    EXPECT_THROW(measure_realism(recording, options), UsageError) << number;
  }
  RealismOptions gap = models_only();
  gap.gaps = {7};
  EXPECT_THROW(measure_realism(recording, gap), UsageError);
}

TEST(MeasureRealism, OfARealRecording) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto recording = open_recording(data / "davis" / "slider_depth", RecordingFormat::kEcd);
  RealismOptions options = models_only();
  options.esim_draws = 1;
  const RealismReport report = measure_realism(*recording, options);
  ASSERT_EQ(report.intervals.size(), 2u);
  EXPECT_NEAR(static_cast<double>(report.intervals[0].event_count), 7778, 5);
  EXPECT_NEAR(static_cast<double>(report.intervals[1].event_count), 11318, 5);
  // Computed apart, from the counts of events: no pixel's sum is far from its clipped one.
  EXPECT_NEAR(report.real.intervals[0].scores.polarity_correlation, 0.7089, 0.005);
  EXPECT_NEAR(report.real.intervals[1].scores.polarity_correlation, 0.7080, 0.005);
  EXPECT_FALSE(report.real.direction.has_value());
  EXPECT_GT(report.methods[0].mean.f1_time, report.methods[1].mean.f1_time);
}

}  // namespace
}  // namespace eventgan
