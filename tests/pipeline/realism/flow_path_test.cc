#include "pipeline/realism/flow_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/testing/fake_recording.h"

namespace eventgan {
namespace {

using testing::FakeRecording;

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

TEST(FlowPath, IsUnknownBeyondThePictureAndWhereTheFlowIs) {
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

TEST(FlowPath, OfAPictureOfOnePixel) {
  const FlowField still{{1, 1}, {0}, {0}};
  const auto path = flow_path(recording_of({still, still}, {1, 1}), {0, 2});
  ASSERT_TRUE(path.has_value());
  EXPECT_EQ(path->x_px[0], 0);
}

TEST(FlowPath, IsNotKnownWithoutFlows) {
  const GreyImage frame{{1, 1}, {0}};
  const FakeRecording recording({frame, frame}, {0, 1}, {});
  EXPECT_FALSE(flow_path(recording, {0, 1}).has_value());
}

}  // namespace
}  // namespace eventgan
