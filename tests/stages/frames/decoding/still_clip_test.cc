#include "stages/frames/decoding/still_clip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "stages/frames/decoding/detail/still_layers.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr ImageSize kStill{96, 128};  // the window begins at row 12, column 16
constexpr int kGround = 40, kObject = 200;

Box square(double left, double top, double side) {
  return {.class_id = 0,
          .xyxy = {left, top, left + side, top + side},
          .outline = {
              {{{left, top}, {left + side, top}, {left + side, top + side}, {left, top + side}}}}};
}

/// A bright square of 20 px at (50, 40) on a dark ground, in as many channels.
std::vector<std::uint8_t> still(std::size_t channels) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < kStill.height; ++y) {
    for (int x = 0; x < kStill.width; ++x) {
      const bool is_object = x >= 50 && x < 70 && y >= 40 && y < 60;
      pixels.insert(pixels.end(), channels, is_object ? kObject : kGround);
    }
  }
  return pixels;
}

StillPose pose(ImageMotion image, ImageMotion object) { return {image, {object}}; }

TEST(StillClip, ShowsItsWindowOfImageAndObjects) {
  for (const std::size_t channels : {1u, 3u}) {
    const auto pixels = still(channels);
    const StillClip clip({kStill, pixels.data(),
                          channels == 1 ? ImageView::Channels::kGrey : ImageView::Channels::kBgr},
                         {square(50, 40, 20)}, pose({}, {}));
    EXPECT_EQ(clip.size(), (ImageSize{72, 96}));
    const auto frame = clip.frame(pose({}, {6, -3, 0, 1}));
    ASSERT_EQ(frame.size(), channels * clip.size().pixel_count());
    const auto at = [&](int x, int y) {
      return frame[channels * static_cast<std::size_t>((y - 12) * 96 + x - 16)];
    };
    EXPECT_EQ(at(66, 47), kObject) << "in the middle of where it is";
    EXPECT_EQ(at(74, 40), kObject);
    EXPECT_EQ(at(52, 57), kGround) << "where it was";
    EXPECT_EQ(at(30, 30), kGround);
  }
}

TEST(StillClip, ResizedFramesAreTheFramesResized) {
  const StillPose moved = pose({1.25, -0.5, 1, 1.02}, {6.5, -3, 2, 1});
  for (const std::size_t channels : {1u, 3u}) {
    const auto pixels = still(channels);
    const StillClip clip({kStill, pixels.data(),
                          channels == 1 ? ImageView::Channels::kGrey : ImageView::Channels::kBgr},
                         {square(50, 40, 20)}, pose({}, {}));
    const auto whole = clip.frame(moved);
    for (const ImageSize size : {clip.size(), ImageSize{36, 48}, ImageSize{50, 110}}) {
      ImageSpec spec;
      spec.size = size;
      spec.fit = ImageFit::kStretch;
      const Placement placement = place(clip.size(), spec);
      const GreyImage resized = clip.resized(placement)(moved);
      ASSERT_EQ(resized.size, size);
      const auto expected =
          prepare_frame({clip.size(), whole.data(),
                         channels == 1 ? ImageView::Channels::kGrey : ImageView::Channels::kBgr},
                        spec);
      int off = 0;
      for (std::size_t i = 0; i < resized.pixels.size(); ++i) {
        const int difference = std::abs(resized.pixels[i] - expected.grey[i]);
        // An eighth of the edge, where the object and how much it covers are sampled as one.
        ASSERT_LE(difference, 20) << i << " of " << to_string(size);
        off += difference > 2;
      }
      EXPECT_LT(off, 2 * (size.height + size.width)) << "beside the object's edge";
    }
  }
}

TEST(StillClip, ShiftsAreThoseOfWhatIsSeen) {
  const auto pixels = still(1);
  const StillClip clip({kStill, pixels.data(), ImageView::Channels::kGrey}, {square(50, 40, 20)},
                       pose({}, {}));
  // The object goes on by (2, 1), and all of it by (-1, 0.5).
  const StillPose from = pose({}, {4, 0, 0, 1}), to = pose({-1, 0.5, 0, 1}, {6, 1, 0, 1});
  const auto shifts = clip.shifts_px(from, to);
  const auto at = [&](int x, int y) { return static_cast<std::size_t>((y - 12) * 96 + x - 16); };
  EXPECT_NEAR(shifts[0][at(64, 50)], 1, 1e-5);
  EXPECT_NEAR(shifts[1][at(64, 50)], 1.5, 1e-5);
  EXPECT_NEAR(shifts[0][at(30, 50)], -1, 1e-5);
  EXPECT_NEAR(shifts[1][at(30, 50)], 0.5, 1e-5);
  EXPECT_NEAR(shifts[0][at(52, 50)], -1, 1e-5) << "the object has left it before `from`";
  EXPECT_NEAR(clip.displacement_px(from, to), std::hypot(1, 1.5), 1e-9);
  EXPECT_EQ(clip.displacement_px(from, from), 0);
}

TEST(StillClip, TurningMovesCornersFarthest) {
  const auto pixels = still(1);
  const StillClip clip({kStill, pixels.data(), ImageView::Channels::kGrey}, {}, StillPose());
  const double angle = 2 * 3.14159265358979 / 180;
  EXPECT_NEAR(clip.displacement_px({}, {{0, 0, 2, 1}, {}}),
              2 * std::sin(angle / 2) * std::hypot(64, 48), 1e-9);
}

TEST(StillClip, RefusesWhatOpenCvCannotMove) {
  const std::vector<std::uint8_t> pixels(kMostStillSide + 1);
  const ImageView wide{{1, kMostStillSide + 1}, pixels.data(), ImageView::Channels::kGrey};
  EXPECT_THROWS(StillClip(wide, {}, StillPose()), std::runtime_error,
                "expected a still of at most 32766 pixels a side, got 32767x1");
}

}  // namespace
}  // namespace eventgan
