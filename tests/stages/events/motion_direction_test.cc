#include "stages/events/realism/motion_direction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "stages/events/event_volume.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr VolumeShape kMovedShape{9, {64, 64}};
constexpr double kSpeedPx = 6;

struct Velocity {
  double x = 0;
  double y = 0;
};

Velocity towards(double angle_deg) {
  const double angle = angle_deg * std::numbers::pi / 180;
  return {kSpeedPx * std::cos(angle), kSpeedPx * std::sin(angle)};
}

std::vector<float> volume_of(std::vector<Event> events) {
  std::ranges::sort(events, {}, &Event::t_s);
  return event_volume(events, kMovedShape);
}

/// A bright disc of 12 px moves by `velocity` over the interval: a pixel has a positive event when
/// the disc's front reaches it, a negative one when its back leaves it.
std::vector<float> moving_disc(Velocity velocity) {
  constexpr double kRadius = 12;
  std::vector<Event> events;
  for (int y = 0; y < kMovedShape.size.height; ++y) {
    for (int x = 0; x < kMovedShape.size.width; ++x) {
      const double from_x = x - (31.5 - velocity.x / 2);
      const double from_y = y - (31.5 - velocity.y / 2);
      // |p - c - v t| = r: v² t² - 2 (p - c)·v t + |p - c|² - r² = 0.
      const double a = kSpeedPx * kSpeedPx;
      const double b = from_x * velocity.x + from_y * velocity.y;
      const double c = from_x * from_x + from_y * from_y - kRadius * kRadius;
      if (b * b < a * c) continue;
      const double root = std::sqrt(b * b - a * c);
      const double enters = (b - root) / a;
      const double leaves = (b + root) / a;
      if (enters >= 0 && enters <= 1) events.push_back({x, y, enters, true});
      if (leaves >= 0 && leaves <= 1) events.push_back({x, y, leaves, false});
    }
  }
  return volume_of(std::move(events));
}

/// A straight edge, across `angle_deg`, that moves along it.
std::vector<float> moving_edge(double angle_deg) {
  const Velocity velocity = towards(angle_deg);
  std::vector<Event> events;
  for (int y = 0; y < kMovedShape.size.height; ++y) {
    for (int x = 0; x < kMovedShape.size.width; ++x) {
      const double t =
          ((x - 31.5) * velocity.x + (y - 31.5) * velocity.y) / (kSpeedPx * kSpeedPx) + 0.5;
      if (t >= 0 && t <= 1) events.push_back({x, y, t, true});
    }
  }
  return volume_of(std::move(events));
}

std::vector<float> backwards(const std::vector<float>& volume) {
  const auto plane = static_cast<std::ptrdiff_t>(kMovedShape.size.pixel_count());
  std::vector<float> result(volume.size());
  for (int channel = 0; channel < kMovedShape.channels(); ++channel) {
    const int polarity = channel / kMovedShape.bins;
    const int mirrored =
        polarity * kMovedShape.bins + kMovedShape.bins - 1 - channel % kMovedShape.bins;
    std::copy_n(volume.begin() + channel * plane, plane, result.begin() + mirrored * plane);
  }
  return result;
}

DirectionScore score_of(const std::vector<float>& volume, Velocity flow,
                        const DirectionSettings& settings = {}) {
  const std::vector<float> x(kMovedShape.size.pixel_count(), static_cast<float>(flow.x));
  const std::vector<float> y(kMovedShape.size.pixel_count(), static_cast<float>(flow.y));
  return motion_direction(volume, kMovedShape, x, y, settings);
}

class MotionDirectionAngles : public ::testing::TestWithParam<int> {};

TEST_P(MotionDirectionAngles, AMovingDiscShowsWhereItGoesAndAnEdgeNothing) {
  const Velocity velocity = towards(GetParam());
  const std::vector<float> volume = moving_disc(velocity);
  DirectionScore score = score_of(volume, velocity);
  EXPECT_GT(score.pixels, 150);  // of about 2 x 24 x 6 that are swept
  EXPECT_EQ(score.fraction(), 1);
  EXPECT_EQ(score_of(volume, towards(GetParam() + 90)).within, 0);
  score = score_of(backwards(moving_disc(velocity)), velocity);
  EXPECT_GT(score.pixels, 150);
  EXPECT_EQ(score.within, 0);
  EXPECT_EQ(score_of(moving_edge(GetParam()), towards(GetParam())).pixels, 0);
}

INSTANTIATE_TEST_SUITE_P(EightDirections, MotionDirectionAngles,
                         ::testing::Values(0, 45, 90, 135, 180, 225, 270, 315));

TEST(MotionDirection, ToleranceIsAnAngleAndFaintNoiseIsNotCounted) {
  std::vector<float> volume = moving_disc(towards(0));
  DirectionSettings wide;
  wide.tolerance_deg = 75;
  EXPECT_EQ(score_of(volume, towards(55), wide).fraction(), 1);
  EXPECT_EQ(score_of(volume, towards(55)).fraction(), 0);
  volume = moving_disc(towards(45));
  const DirectionScore clean = score_of(volume, towards(45));
  for (std::size_t i = 0; i < volume.size(); i += 8) volume[i] += 1e-3f;
  const DirectionScore noisy = score_of(volume, towards(45));
  EXPECT_EQ(noisy.pixels, clean.pixels);
  EXPECT_EQ(noisy.fraction(), 1);
}

TEST(MotionDirection, StillEmptyUnknownAndSmallHaveNoPixels) {
  std::vector<float> volume = moving_disc(towards(0));
  EXPECT_EQ(score_of(volume, {0, 0}).pixels, 0);
  EXPECT_EQ(score_of(volume, {0.5, 0.5}).pixels, 0);
  EXPECT_EQ(score_of(volume, {std::numeric_limits<double>::quiet_NaN(), 3}).pixels, 0);
  EXPECT_EQ(score_of(volume, {std::numeric_limits<double>::infinity(), 3}).pixels, 0);
  const DirectionScore empty =
      score_of(std::vector<float>(kMovedShape.value_count(), 0.0f), towards(0));
  EXPECT_EQ(empty.pixels, 0);
  EXPECT_EQ(empty.fraction(), 0);
  volume = std::vector<float>(2 * 9 * 2 * 3, 1.0f);
  const std::vector<float> flow(6, 2.0f);
  EXPECT_EQ(motion_direction(volume, {9, {2, 3}}, flow, flow).pixels, 0);
}

TEST(MotionDirection, RefusesSizesThatDiffer) {
  const VolumeShape shape{1, {1, 2}};
  const std::vector<float> volume(4, 0.0f);
  const std::vector<float> flow(2, 1.0f);
  EXPECT_THROWS(motion_direction({}, shape, flow, flow), std::invalid_argument,
                "expected a volume [2, H, W] and flows of 2x1 pixels, got 0");
  EXPECT_THROWS(motion_direction(volume, shape, {}, flow), std::invalid_argument,
                "expected a volume [2, H, W] and flows of 2x1 pixels, got 4");
  EXPECT_THROWS(motion_direction(volume, shape, flow, volume), std::invalid_argument,
                "expected a volume [2, H, W] and flows of 2x1 pixels, got 4");
  EXPECT_THROWS(motion_direction({}, {1, {0, 0}}, {}, {}), std::invalid_argument,
                "expected a volume [2, H, W] and flows of 0x0 pixels, got 0");
  DirectionSettings even;
  even.window = 4;
  EXPECT_THROWS(motion_direction(volume, shape, flow, flow, even), std::invalid_argument,
                "expected an odd window, got 4");
  const std::vector<float> unsound{0, std::numeric_limits<float>::quiet_NaN(), 0, 0};
  EXPECT_THROWS(motion_direction(unsound, shape, flow, flow), std::invalid_argument,
                "expected finite values >= 0, got nan");
}

}  // namespace
}  // namespace eventgan
