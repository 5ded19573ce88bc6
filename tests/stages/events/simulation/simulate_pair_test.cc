#include "stages/events/simulation/simulate_pair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <span>
#include <stdexcept>

#include "stages/events/simulation/affine_motion.h"
#include "stages/events/simulation/flow_interval.h"
#include "stages/events/simulation/sensor.h"
#include "tests/stages/events/simulation/simulated_images.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::exact_sensor;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using testing::texture;
using testing::textured_image;

TEST(LinearIntensity, IsTheGreyValueOver255OfAnImage) {
  EXPECT_THAT(linear_intensity({{1, 3}, {0, 51, 255}}), ::testing::ElementsAre(0.0f, 0.2f, 1.0f));
  EXPECT_THROWS(linear_intensity({}), std::invalid_argument,
                "expected an image, got 0x0 with 0 pixels");
  EXPECT_THROWS(linear_intensity({{0, 4}, {}}), std::invalid_argument,
                "expected an image, got 4x0 with 0 pixels");
  EXPECT_THROWS(linear_intensity({{2, 2}, {1, 2, 3}}), std::invalid_argument,
                "expected an image, got 2x2 with 3 pixels");
}

AffineMotion shift(double dx, double dy) { return {{1, 0, dx, 0, 1, dy}}; }

TEST(RandomAffineMotion, HasTheDisplacementAskedFor) {
  for (const ImageSize size : {ImageSize{1, 1}, {1, 9}, {8, 8}, {180, 320}, {261, 99}}) {
    for (const double displacement : {0.0, 0.01, 1.0, 6.0, 40.0}) {
      for (std::uint64_t seed = 0; seed < 20; ++seed) {
        const AffineMotion motion = random_affine_motion(size, displacement, CounterRandom(seed));
        EXPECT_NEAR(largest_displacement(motion, size), displacement, 1e-9);
        const auto& m = motion.matrix;
        // ‖A₁ - I‖ ≤ 1/2 keeps the determinant at 1/4 or more.
        EXPECT_GE(m[0] * m[4] - m[1] * m[3], 0.25 - 1e-9);
      }
    }
  }
}

TEST(RandomAffineMotion, DiffersBySeedAndIsMoreThanATranslation) {
  const AffineMotion one = random_affine_motion({180, 320}, 6, CounterRandom(1));
  EXPECT_EQ(one.matrix, random_affine_motion({180, 320}, 6, CounterRandom(1)).matrix);
  EXPECT_NE(one.matrix, random_affine_motion({180, 320}, 6, CounterRandom(2)).matrix);
  EXPECT_NE(one.matrix[0], 1);
  EXPECT_NE(one.matrix[1], 0);
  for (const double bad : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROWS(random_affine_motion({8, 8}, bad, CounterRandom(1)), std::invalid_argument,
                  "expected a displacement >= 0 px");
  }
}

TEST(RenderAffine, IsTheImageAtTheStartAndMovesTheWayOfTheMatrix) {
  GreyImage image = textured_image({37, 53});
  const AffineMotion motion = random_affine_motion(image.size, 6, CounterRandom(1));
  EXPECT_EQ(render_affine(image, motion, 0), linear_intensity(image));
  image = GreyImage{{1, 5}, {10, 20, 30, 40, 50}};
  const std::vector<float> moved = render_affine(image, shift(2, 0), 1);
  // Right by two; mirrored about the first pixel at the left.
  EXPECT_EQ(moved, linear_intensity({{1, 5}, {30, 20, 10, 20, 30}}));
  const std::vector<float> halfway = render_affine(image, shift(3, 0), 0.5);
  EXPECT_NEAR(halfway[3] * 255, 25, 1e-4);  // bilinear between 20 and 30
  EXPECT_EQ(render_affine({{1, 1}, {51}}, shift(3, 2), 1), std::vector<float>{0.2f});
}

// Later versions of OpenCV compute warpAffine in another way, and arm64's round products with sums.
#if CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR <= 10 && defined(__x86_64__)
TEST(RenderAffine, IsWarpAffineOfOpenCvToTheLastBit) {
  for (const ImageSize size : {ImageSize{1, 9}, ImageSize{7, 1}, ImageSize{61, 143}}) {
    const GreyImage image = textured_image(size);
    std::vector<float> still = linear_intensity(image);
    const cv::Mat source(size.height, size.width, CV_32FC1, still.data());
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      const AffineMotion motion =
          random_affine_motion(size, 0.5 * static_cast<double>(seed), CounterRandom(seed));
      std::vector<float> expected(still.size());
      cv::Mat target(source.size(), source.type(), expected.data());
      const auto& m = motion.matrix;
      cv::warpAffine(source, target, cv::Matx23d(m[0], m[1], m[2], m[3], m[4], m[5]), target.size(),
                     cv::INTER_LINEAR, cv::BORDER_REFLECT_101);
      ASSERT_EQ(render_affine(image, motion, 1), expected) << seed;
    }
  }
}
#endif

TEST(AffineInterval, TakesStepsOfAPixelAtMost) {
  const auto steps = [](const AffineMotion& motion) {
    return AffineInterval(textured_image({9, 9}), motion).steps();
  };
  EXPECT_EQ(steps({}), 1);
  EXPECT_EQ(steps(shift(0.2, 0)), 1);
  EXPECT_EQ(steps(shift(1, 0)), 1);
  EXPECT_EQ(steps(shift(1.01, 0)), 2);
  EXPECT_EQ(steps(shift(3, 4)), 5);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    EXPECT_EQ(steps(random_affine_motion({9, 9}, 6, CounterRandom(seed))), 6);
  }
}

/// Image `step` of the interval, row by row.
std::vector<float> rendered(const AffineInterval& interval, int step, ImageSize size) {
  const auto width = static_cast<std::size_t>(size.width);
  std::vector<float> intensity(size.pixel_count());
  for (int y = 0; y < size.height; ++y) {
    interval.render_row(step, y,
                        std::span(intensity).subspan(static_cast<std::size_t>(y) * width, width));
  }
  return intensity;
}

TEST(AffineInterval, LeadsFromTheImageToWhereTheMatrixTakesIt) {
  const GreyImage image = textured_image({60, 80});
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const AffineMotion motion = random_affine_motion(image.size, 6, CounterRandom(seed));
    const AffineInterval interval(image, motion);
    EXPECT_EQ(rendered(interval, 0, image.size), linear_intensity(image));
    EXPECT_EQ(rendered(interval, 1, image.size),
              render_affine(image, motion, 1.0 / interval.steps()));
    const std::vector<float> last = rendered(interval, interval.steps(), image.size);
    double largest = 0;
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 80; ++x) {
        // What lands on an inner pixel (x, y) comes from p with A₁ p = (x, y); the motion is
        // smooth, so that fixed point is found in some rounds.
        double px = x;
        double py = y;
        const auto& m = motion.matrix;
        for (int round = 0; round < 60; ++round) {
          const double dx = (m[0] - 1) * px + m[1] * py + m[2];
          const double dy = m[3] * px + (m[4] - 1) * py + m[5];
          px = x - dx;
          py = y - dy;
        }
        if (px < 0 || py < 0 || px > 79 || py > 59) continue;
        const double seen = last[static_cast<std::size_t>(y * 80 + x)];
        largest = std::max(largest, std::abs(seen - texture(px, py)));
      }
    }
    // Slope at most 0.2 a pixel: 1/64 px of rounded place an axis, second differences below 0.15
    // / 8 an axis for bilinear, half a grey level.
    EXPECT_LT(largest, 0.2 / 64 * 2 + 0.15 / 8 * 2 + 0.002) << seed;
  }
}

constexpr ImageSize kPairSize{90, 120};

/// PSNR in dB of a rendered image against the texture moved right by dx, `margin` px inside.
double psnr(const std::vector<float>& rendered, double dx, int margin) {
  double squares = 0;
  int count = 0;
  for (int y = margin; y < kPairSize.height - margin; ++y) {
    for (int x = margin; x < kPairSize.width - margin; ++x, ++count) {
      const double error =
          rendered[static_cast<std::size_t>(y * kPairSize.width + x)] - texture(x - dx, y);
      squares += error * error;
    }
  }
  return -10 * std::log10(squares / count);
}

TEST(FlowInterval, BeginsAndEndsWithTheFrames) {
  const GreyImage previous = textured_image(kPairSize);
  const GreyImage next = textured_image(kPairSize, 6);
  const FlowInterval interval(previous, next);
  EXPECT_EQ(interval.size(), kPairSize);
  EXPECT_EQ(interval.render(0), linear_intensity(previous));
  EXPECT_EQ(interval.render(interval.steps()), linear_intensity(next));
}

TEST(FlowInterval, MovesATextureAlongItsShift) {
  const FlowInterval interval(textured_image(kPairSize), textured_image(kPairSize, 6));
  EXPECT_GE(interval.steps(), 6);
  EXPECT_LE(interval.steps(), 8);
  for (int step = 1; step < interval.steps(); ++step) {
    const std::vector<float> rendered = interval.render(step);
    const double dx = 6.0 * step / interval.steps();
    // Half a grey level of rounding would give 59 dB; the flow's error of some 0.05 px costs most.
    EXPECT_GT(psnr(rendered, dx, 10), 45) << step;
    EXPECT_GT(psnr(rendered, dx, 0), 40) << step;
  }
}

TEST(FlowInterval, FlowIsTheShift) {
  const FlowDisplacement flow =
      FlowInterval(textured_image(kPairSize), textured_image(kPairSize, 4, -3)).flow();
  double error = 0;
  for (int y = 15; y < kPairSize.height - 15; ++y) {
    for (int x = 15; x < kPairSize.width - 15; ++x) {
      const auto i = static_cast<std::size_t>(y * kPairSize.width + x);
      error = std::max(error, std::hypot(flow.x_px[i] - 4.0, flow.y_px[i] + 3.0));
    }
  }
  EXPECT_LT(error, 0.2);
}

TEST(FlowInterval, StaysStillBetweenEqualFramesAndOneWithoutTextureFades) {
  const GreyImage image = textured_image(kPairSize);
  const FlowInterval interval(image, image);
  EXPECT_EQ(interval.steps(), 1);
  for (const float x : interval.flow().x_px) EXPECT_NEAR(x, 0, 0.01);
  EXPECT_THROWS(FlowInterval(textured_image({9, 8}), textured_image({8, 9})), std::invalid_argument,
                "expected two frames of one size");
  EXPECT_THROWS(FlowInterval(GreyImage{}, GreyImage{}), std::invalid_argument,
                "expected an image, got 0x0 with 0 pixels");
}

TEST(FlowInterval, ABrighteningImageWithoutTextureFades) {
  const GreyImage dark{kPairSize, std::vector<std::uint8_t>(kPairSize.pixel_count(), 0)};
  const GreyImage bright{kPairSize, std::vector<std::uint8_t>(kPairSize.pixel_count(), 255)};
  const FlowInterval interval(dark, bright);
  const int half = interval.steps() / 2;
  const float expected = static_cast<float>(half) / static_cast<float>(interval.steps());
  for (const float value : interval.render(half)) EXPECT_NEAR(value, expected, 1e-4);
}

TEST(FlowInterval, TakesTheSmallestAndOddSizes) {
  for (const ImageSize size : {ImageSize{1, 1}, {1, 40}, {7, 3}, {33, 65}, {200, 5}}) {
    const FlowInterval interval(textured_image(size), textured_image(size, 2));
    for (int step = 0; step <= interval.steps(); ++step) {
      const std::vector<float> rendered = interval.render(step);
      ASSERT_EQ(rendered.size(), size.pixel_count());
      for (const float value : rendered) EXPECT_TRUE(value >= 0 && value <= 1) << value;
    }
  }
}

TEST(FlowInterval, DoesNotDependOnTheNumberOfThreads) {
  const auto image_at = [](int threads) {
    const int before = cv::getNumThreads();
    cv::setNumThreads(threads);
    const FlowInterval interval(textured_image(kPairSize), textured_image(kPairSize, 5, 2));
    const std::vector<float> rendered = interval.render(2);
    cv::setNumThreads(before);
    return rendered;
  };
  EXPECT_EQ(image_at(1), image_at(3));
}

TEST(AffineInterval, AMovedEdgeFiresAlongItsWay) {
  // Bright (255) up to x = 7, dark (51) right of it, moved right by 4 px in 0.4 s: pixels 8..11
  // brighten one after the other, 0.1 s each, by ln(1.001/0.201) = 1.605: 5 events of 0.3.
  GreyImage image{{2, 14}, {}};
  for (int i = 0; i < 28; ++i) image.pixels.push_back(i % 14 <= 7 ? 255 : 51);
  const AffineInterval interval(image, {{1, 0, 4, 0, 1, 0}});
  const SensorSpec spec = exact_sensor(0.3);
  ASSERT_EQ(interval.steps(), 4);
  const auto row = [&](std::size_t step, int y, std::span<float> intensity) {
    interval.render_row(static_cast<int>(step), y, intensity);
  };
  std::vector<Event> events =
      pixel_events(spec, image.size, row, std::array{0.0, 0.1, 0.2, 0.3, 0.4}, CounterRandom(1));
  std::ranges::sort(events, comes_before);
  ASSERT_THAT(events, SizeIs(4 * 5 * 2));
  const double change = std::log(1.001 / 0.201);
  for (std::size_t i = 0; i < events.size(); ++i) {
    const auto column = static_cast<int>(i) / 10;
    const auto k = static_cast<int>(i) / 2 % 5 + 1;
    EXPECT_EQ(events[i].x, 8 + column);
    EXPECT_EQ(events[i].y, static_cast<int>(i) % 2);
    EXPECT_TRUE(events[i].positive);
    EXPECT_NEAR(events[i].t_s, 0.1 * (column + 0.3 * k / change), 1e-6);
  }
}

TEST(SimulateAffine, RefusesADurationOfNothing) {
  const GreyImage image = textured_image({4, 4});
  EXPECT_THROWS(simulate_affine(image, 0, {}, 0, CounterRandom(1)), std::invalid_argument,
                "expected a time after 0.000000 s, got 0.000000 s");
  EXPECT_THROWS(simulate_affine(image, 0, {}, -1, CounterRandom(1)), std::invalid_argument,
                "expected a time after 0.000000 s, got -1.000000 s");
}

TEST(FeedInterval, GoesOnWhereTheIntervalBeforeEnded) {
  const SensorSpec spec = exact_sensor(0.1);
  const FlowInterval there(textured_image({20, 30}), textured_image({20, 30}, 3));
  ASSERT_GT(there.steps(), 1);
  Sensor sensor(spec, there.size(), CounterRandom(1));
  sensor.step(there.render(0), 1);
  std::vector<Event> events;
  feed_interval(sensor, there, 1, 1.3, events);
  const std::size_t first = events.size();
  ASSERT_GT(first, 0u);
  EXPECT_LE(events.back().t_s, 1.3);
  feed_interval(sensor, there, 1.3, 1.7, events);
  ASSERT_GT(events.size(), first);
  EXPECT_GT(events[first].t_s, 1.3);
  EXPECT_LE(events.back().t_s, 1.7);
}

TEST(SimulateAffine, AStillImageGivesNoEventsAndOnePixelIsTaken) {
  EXPECT_THAT(simulate_affine(textured_image({30, 40}), 0, SensorSpec{}, 0.1, CounterRandom(1)),
              IsEmpty());
  EXPECT_THAT(simulate_affine({{1, 1}, {9}}, 6, SensorSpec{}, 0.1, CounterRandom(1)), IsEmpty());
}

TEST(SimulateAffine, IsAFunctionOfTheSeed) {
  const GreyImage image = textured_image({30, 40});
  const auto events = [&](std::uint64_t seed) {
    return simulate_affine(image, 6, exact_sensor(0.1), 0.1, CounterRandom(seed));
  };
  EXPECT_THAT(events(1), ::testing::Not(IsEmpty()));
  EXPECT_EQ(events(1), events(1));
  EXPECT_NE(events(1), events(2));
  EXPECT_THROWS(simulate_affine(image, -1, {}, 0.1, CounterRandom(1)), std::invalid_argument,
                "expected a displacement >= 0 px, got -0.783683");
}

TEST(SimulateDifference, GivesTheWholeThresholdsOfTheChange) {
  const GreyImage previous{{1, 4}, {10, 0, 255, 100}};
  const GreyImage next{{1, 4}, {200, 255, 0, 100}};
  const std::vector<Event> events =
      simulate_difference(previous, next, exact_sensor(0.2), 0.05, CounterRandom(1));
  std::vector<int> net(4);
  for (const Event& event : events)
    net[static_cast<std::size_t>(event.x)] += event.positive ? 1 : -1;
  const auto whole = [](double from, double to) {
    return static_cast<int>((std::log(to / 255 + 0.001) - std::log(from / 255 + 0.001)) / 0.2);
  };
  EXPECT_THAT(net, ::testing::ElementsAre(whole(10, 200), whole(0, 255), whole(255, 0), 0));
  EXPECT_EQ(events.size(), static_cast<std::size_t>(net[0] + net[1] - net[2]));
}

TEST(SimulateDifference, RefusesFramesOfTwoSizes) {
  EXPECT_THROWS(simulate_difference({{2, 1}, {1, 2}}, {{1, 2}, {1, 2}}, {}, 1, CounterRandom(1)),
                std::invalid_argument, "expected frames of one size");
}

}  // namespace
}  // namespace eventgan
