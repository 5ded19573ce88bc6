#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "manifests/values/still_motion.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "tests/stages/frames/decoding/still_image.h"

namespace eventgan {
namespace {

// The flow that MovingStill tells of a pair is held against the two frames that it makes, and
// against places that are computed here.

constexpr double kStep_px = 1.0 / 128;

/// Smooth enough to be sampled between pixels.
cv::Mat smooth_noise(ImageSize size, double blur) {
  cv::Mat image = noise(size);
  cv::GaussianBlur(image, image, {}, blur);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

struct FlowCase {
  std::array<PreparedFrame, 2> frames;
  PixelFlow flow;
  double label_position;

  ImageSize volume() const { return frames[0].placement.volume; }
  VisiblePart part() const { return visible_part(frames[0].placement); }

  std::size_t pixel(int x, int y) const {
    return static_cast<std::size_t>(y) * volume().width + static_cast<std::size_t>(x);
  }
  Point flow_at(int x, int y) const {
    return {flow.px[pixel(x, y)], flow.px[volume().pixel_count() + pixel(x, y)]};
  }
  bool is_valid(int x, int y) const { return flow.valid[pixel(x, y)] != 0; }

  /// Where a pixel of the labelled frame lies in the other one.
  Point target(int x, int y) const {
    const Point by = flow_at(x, y);
    return label_position == 0 ? Point{x + by.x, y + by.y} : Point{x - by.x, y - by.y};
  }

  /// Of the labelled frame or the other one, between pixels' centres; places in the volume.
  double level(bool labelled, Point at) const {
    const std::vector<std::uint8_t>& grey = frames[labelled == (label_position == 1)].grey;
    const double x = at.x - part().volume_x, y = at.y - part().volume_y;
    const int width = part().size.width, height = part().size.height;
    const int left = std::min(static_cast<int>(x), width - 2);
    const int top = std::min(static_cast<int>(y), height - 2);
    const auto value = [&](int column, int row) {
      return grey[static_cast<std::size_t>(row * width + column)];
    };
    const double right_share = x - left, lower_share = y - top;
    return (1 - lower_share) *
               ((1 - right_share) * value(left, top) + right_share * value(left + 1, top)) +
           lower_share *
               ((1 - right_share) * value(left, top + 1) + right_share * value(left + 1, top + 1));
  }

  /// Mean difference of the labelled frame and the other one at the flow's targets, where valid;
  /// `moved`: else at the same places.
  double mean_error(bool moved) const {
    double sum = 0;
    int count = 0;
    for_each_pixel([&](int x, int y) {
      if (!is_valid(x, y)) return;
      const Point at{double(x), double(y)};
      sum += std::abs(level(true, at) - level(false, moved ? target(x, y) : at));
      ++count;
    });
    return sum / count;
  }

  /// Calls each(x, y) for every pixel of the volume that shows the image.
  template <class Each>
  void for_each_pixel(const Each& each) const {
    const VisiblePart shown = part();
    for (int y = shown.volume_y; y < shown.volume_y + shown.size.height; ++y) {
      for (int x = shown.volume_x; x < shown.volume_x + shown.size.width; ++x) each(x, y);
    }
  }
};

FlowCase make(const cv::Mat& grey, const FramePair& pair, const ImageSpec& spec,
              const std::vector<Box>& boxes = {}) {
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  FlowCase made{.frames = {}, .flow = {}, .label_position = pair.label_position};
  const auto image = std::make_shared<const ColourFrame>(
      ColourFrame{{grey.rows, grey.cols}, {colour.datastart, colour.dataend}});
  const MovingStill still(image, pair, spec, boxes);
  const FramesBetween frames = still.frames(pair);
  for (const int end : {0, 1}) made.frames[end] = {frames.at(end).pixels, still.placement()};
  made.flow = still.flow(pair);
  return made;
}

FramePair pair_of(const ImageMotion& motion, double label_position) {
  FramePair pair;
  pair.motion = motion;
  pair.label_position = label_position;
  return pair;
}

TEST(StillFlow, OfAShiftIsTheShift) {
  const cv::Mat image = noise({30, 40});
  ImageSpec spec;
  spec.size = ImageSize{24, 32};  // the shift takes 3 rows and 4 columns a side: nothing is scaled
  for (const double position : {0.0, 1.0}) {
    SCOPED_TRACE(position);
    const FlowCase made = make(image, pair_of({.x_px = 4, .y_px = -3}, position), spec);
    ASSERT_EQ(made.flow.px.size(), 2u * 24 * 32);
    made.for_each_pixel([&](int x, int y) {
      ASSERT_EQ(made.flow_at(x, y), (Point{4, -3})) << x << ", " << y;
      // The previous frame shows what comes to lie here at (x - 4, y + 3), the next one what lay
      // here at (x + 4, y - 3).
      const bool is_seen = position == 0 ? x + 4 <= 31 && y - 3 >= 0 : x - 4 >= 0 && y + 3 <= 23;
      ASSERT_EQ(made.is_valid(x, y), is_seen) << x << ", " << y;
    });
    EXPECT_EQ(made.mean_error(true), 0);
    EXPECT_GT(made.mean_error(false), 50);
  }
}

TEST(StillFlow, WithoutMotionIsZeroAndValid) {
  ImageSpec spec;
  spec.size = ImageSize{31, 57};
  for (const double position : {0.0, 1.0}) {
    const FlowCase made = make(noise({40, 60}), pair_of({}, position), spec);
    EXPECT_EQ(made.flow.px, std::vector<float>(made.flow.px.size()));
    EXPECT_EQ(made.flow.valid, std::vector<std::uint8_t>(made.flow.valid.size(), 1));
  }
}

struct Fit {
  ImageFit fit;
  ImageSize volume;
};

TEST(StillFlow, LeadsToTheSamePlaceOfTheOtherFrameWhateverThePlacement) {
  const ImageSize size{120, 160};
  const cv::Mat image = smooth_noise(size, 3);
  const ImageMotion motion{3.3, -5.7, 1.8, 1.02};
  for (const Fit& each : {Fit{ImageFit::kStretch, {130, 150}},
                          {ImageFit::kLetterbox, {200, 200}},
                          {ImageFit::kCrop, {100, 140}}}) {
    ImageSpec spec;
    spec.size = each.volume;
    spec.fit = each.fit;
    for (const double position : {0.0, 1.0}) {
      SCOPED_TRACE(std::string(to_string(each.fit)) + (position == 1 ? " before" : " after"));
      const FlowCase made = make(image, pair_of(motion, position), spec);
      EXPECT_LT(made.mean_error(true), 3);
      EXPECT_GT(made.mean_error(false), 20);
      const Placement& placement = made.frames[0].placement;
      const AffineMap to_volume = placement.source_to_volume();
      const AffineMap forward = map_of(motion, {79.5, 59.5});
      std::size_t valid = 0;
      made.for_each_pixel([&](int x, int y) {
        const Point labelled = mapped(inverse(to_volume), {double(x), double(y)});
        const Point other =
            mapped(to_volume, mapped(position == 0 ? forward : inverse(forward), labelled));
        const double sign = position == 0 ? 1 : -1;
        ASSERT_NEAR(made.flow_at(x, y).x, sign * (other.x - x), kStep_px / 2 + 1e-6);
        ASSERT_NEAR(made.flow_at(x, y).y, sign * (other.y - y), kStep_px / 2 + 1e-6);
        valid += made.is_valid(x, y);
      });
      EXPECT_GT(valid, made.part().size.pixel_count() * 3 / 4);
      std::size_t all = 0;
      for (const std::uint8_t each_valid : made.flow.valid) all += each_valid;
      EXPECT_EQ(all, valid) << "none where there is no image";
    }
  }
}

TEST(StillFlow, OfObjectsIsTheirOwnAndEndsWhereTheyCover) {
  const ImageSize size{60, 80};
  const Rectangle box{30, 22, 50, 45};
  for (const double position : {0.0, 1.0}) {
    SCOPED_TRACE(position);
    FramePair pair = pair_of({}, position);
    pair.objects = {ImageMotion{.x_px = 6, .y_px = -5}};
    const FlowCase made = make(noise(size), pair, {}, {object_at(box)});
    const int dx = position == 0 ? 6 : -6, dy = position == 0 ? -5 : 5;
    const Rectangle there{box.left + dx, box.top + dy, box.right + dx, box.bottom + dy};
    int covered = 0;
    made.for_each_pixel([&](int x, int y) {
      if (inside(box, x, y)) {
        ASSERT_EQ(made.flow_at(x, y), (Point{6, -5})) << x << ", " << y;
        ASSERT_TRUE(made.is_valid(x, y)) << x << ", " << y;
      } else {
        ASSERT_EQ(made.flow_at(x, y), (Point{0, 0})) << x << ", " << y;
        ASSERT_EQ(made.is_valid(x, y), !inside(there, x, y)) << x << ", " << y;
        covered += !made.is_valid(x, y);
      }
    });
    EXPECT_EQ(covered, 20 * 23 - 14 * 18) << "of the object there what is not covered here";
  }
}

TEST(StillFlow, OfObjectsInAMovingImageLeadsToTheSamePlaces) {
  const ImageSize size{120, 160};
  const cv::Mat image = smooth_noise(size, 2);
  ImageSpec spec;
  spec.size = ImageSize{90, 120};
  for (const double position : {0.0, 1.0}) {
    FramePair pair = pair_of({2.2, -1.4, 1, 1.01}, position);
    pair.objects = {ImageMotion{-7.5, 3, 4, 0.96}, ImageMotion{6.5, -4, -3, 1.03}, ImageMotion()};
    const FlowCase made = make(
        image, pair, spec,
        {object_at({40, 30, 80, 70}), object_at({70, 40, 110, 90}), object_at({10, 60, 30, 100})});
    EXPECT_LT(made.mean_error(true), 8);  // around the objects a few pixels are filled
    EXPECT_GT(made.mean_error(false), 15);
  }
}

TEST(StillFlow, OfAClipIsFromOnePoseToTheOther) {
  const cv::Mat image = smooth_noise({96, 128}, 2);  // the window begins at row 12, column 16
  const StillPose from{{}, {ImageMotion{4, 0, 0, 1}}};
  const StillPose to{{-1, 0.5, 0, 1}, {ImageMotion{6, 1, 0, 1}}};
  for (const double position : {0.0, 1.0}) {
    SCOPED_TRACE(position);
    FramePair pair;
    pair.label_position = position;
    pair.poses = {from, to};
    const FlowCase made = make(image, pair, {}, {object_at({50, 40, 70, 60})});
    ASSERT_EQ(made.volume(), (ImageSize{72, 96}));
    // The object goes on by (2, 1), and all of it by (-1, 0.5).
    EXPECT_EQ(made.flow_at(64 - 16, 50 - 12), (Point{1, 1.5}));
    EXPECT_EQ(made.flow_at(30 - 16, 30 - 12), (Point{-1, 0.5}));
    EXPECT_TRUE(made.is_valid(64 - 16, 50 - 12));
    EXPECT_LT(made.mean_error(true), 4);
    EXPECT_GT(made.mean_error(false), 6);
  }
}

}  // namespace
}  // namespace eventgan
