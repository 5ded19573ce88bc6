#include "pipeline/simulation/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "pipeline/simulation/affine_scene.h"
#include "stages/recordings/open_recording.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

/// A bright half-plane that moves 2 px to the right in each of two intervals.
AffineScene moving_edge() {
  const ImageSize size{8, 32};
  GreyImage picture{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) picture.pixels.push_back(x < 16 ? 200 : 50);
  }
  AffineMotion motion;
  motion.matrix = {1, 0, 6, 0, 1, 0};
  return AffineScene(picture, motion, 3, 0.1);
}

SensorSpec quiet_sensor() {
  SensorSpec spec;
  spec.threshold_spread = 0;
  return spec;
}

TEST(Record, WritesFramesEventsAndFlows) {
  const testing::TemporaryFolder folder;
  AffineScene scene = moving_edge();
  const GreyImage first = scene.frame();
  int shown = 0;
  const RecordingSummary summary =
      record(scene, quiet_sensor(), CounterRandom(1), folder / "edge.hdf5", "{}", [&] { ++shown; });
  EXPECT_EQ(summary.name, "edge");
  EXPECT_EQ(summary.frames, 3);
  EXPECT_EQ(shown, 3);
  EXPECT_DOUBLE_EQ(summary.duration_s, 0.2);
  EXPECT_EQ(summary.pixels, 8 * 32);
  EXPECT_NEAR(summary.displacement_px, 2, 1e-5);
  // Four columns turn bright: ln((200 + 0.255)/(50 + 0.255)) = 1.382, six thresholds of 0.2 each.
  EXPECT_EQ(summary.events, 8 * 4 * 6);

  const auto recording = open_recording(folder / "edge.hdf5", RecordingFormat::kMvsec);
  EXPECT_EQ(recording->frame_count(), 3);
  EXPECT_EQ(recording->frame(0), first);
  EXPECT_EQ(recording->frame(2), scene.frame());
  EXPECT_DOUBLE_EQ(recording->frame_time_s(2), 0.2);
  const std::vector<Event> events = recording->events_between(0, 1);
  EXPECT_EQ(events.size(), 8u * 2 * 6);
  for (const Event& event : events) {
    EXPECT_TRUE(event.positive);
    EXPECT_GE(event.x, 18);  // the first frame has moved 2 px already
    EXPECT_LE(event.x, 19);
    EXPECT_GT(event.t_s, 0);
    EXPECT_LE(event.t_s, 0.1);
  }
  EXPECT_NEAR(recording->flow(1).value().x_px.at(0), 2, 1e-5);
}

TEST(Record, RefusesNoiseThatDoesNotFitIntoMemory) {
  const testing::TemporaryFolder folder;
  AffineScene scene(GreyImage{{2, 2}, {1, 2, 3, 4}}, {}, 2, 1e9);  // 1e9 s between its frames
  SensorSpec spec = quiet_sensor();
  spec.shot_noise_rate_hz = 1e6;
  EXPECT_THAT(
      [&] { record(scene, spec, CounterRandom(1), folder / "a.hdf5", "{}", [] {}); },
      ::testing::ThrowsMessage<std::runtime_error>(::testing::HasSubstr("about 4e+15 events")));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Record, LeavesNothingIfTheSceneFails) {
  class BrokenScene final : public Scene {
   public:
    const GreyImage& frame() const override { return frame_; }
    double time_s() const override { return 0; }
    std::unique_ptr<Interval> advance() override { throw std::runtime_error("broken"); }
    bool has_flow() const override { return false; }

   private:
    GreyImage frame_{{2, 2}, {1, 2, 3, 4}};
  } scene;
  const testing::TemporaryFolder folder;
  EXPECT_THROW(record(scene, {}, CounterRandom(1), folder / "a.hdf5", "{}", [] {}),
               std::runtime_error);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace eventgan
