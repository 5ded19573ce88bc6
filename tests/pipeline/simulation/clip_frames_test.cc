#include "pipeline/simulation/clip_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "manifests/values/faults.h"
#include "pipeline/simulation/scene.h"
#include "stages/events/simulation/simulate_pair.h"
#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// Columns of these values.
GreyImage columns(int height, const std::vector<int>& values) {
  GreyImage frame{{height, static_cast<int>(values.size())}, {}};
  for (int y = 0; y < height; ++y) {
    frame.pixels.insert(frame.pixels.end(), values.begin(), values.end());
  }
  return frame;
}

TEST(GreyImageOfAFrame, IsByBt601) {
  // 0.114 x 200 = 22.8 of blue alone.
  const ColourFrame blue{{1, 1}, {200, 0, 0}};
  EXPECT_EQ(grey_image(blue), (GreyImage{{1, 1}, {23}}));
}

TEST(SensorImage, IsScaledToCoverAndCutAroundTheCentre) {
  // 8 x 2 covers 2 x 1 by the scale 1/2: 4 x 1, of which the middle two are left.
  GreyImage frame = columns(2, {0, 0, 10, 30, 100, 200, 0, 0});
  EXPECT_EQ(sensor_image(frame, ImageSize{1, 2}), (GreyImage{{1, 2}, {20, 150}}));
  const GreyImage image = sensor_image(columns(2, {50, 50}), ImageSize{6, 4});
  EXPECT_EQ(image, (GreyImage{{6, 4}, std::vector<std::uint8_t>(24, 50)}));
  frame = columns(3, {0, 255, 3});
  EXPECT_EQ(sensor_image(frame, ImageSize{3, 3}), sensor_image(frame, std::nullopt));
  EXPECT_EQ(sensor_image(frame, std::nullopt).pixels,
            (std::vector<std::uint8_t>{0, 255, 3, 0, 255, 3, 0, 255, 3}));
}

class ClipFramesTest : public ::testing::Test {
 protected:
  /// Frame i is flat, of value 10 i.
  void write_frame(int number, ImageSize size = {20, 30}) {
    testing::write_flat_image(folder_ / "clip" / ("f" + std::to_string(number) + ".png"), size,
                              10 * number);
  }

  ClipFrames open(const std::string& source, const std::string& more = "") {
    manifest_ = testing::moving_clip_manifest(folder_.path(), source, more);
    return ClipFrames(manifest_.sources.at(0), manifest_);
  }

  std::string refusal(const std::string& source) {
    try {
      open(source);
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  }

  testing::TemporaryFolder folder_;
  SimulationManifest manifest_;
};

TEST_F(ClipFramesTest, TakesEachNthFromTheFirstOn) {
  for (int i = 0; i < 12; ++i) write_frame(i);
  ClipFrames clip = open(R"({"path": "clip", "first_frame": 2, "frame_step": 4})");
  ASSERT_EQ(clip.count(), 3);  // 2, 6, 10
  EXPECT_EQ(clip.number(1), 6);
  EXPECT_EQ(clip.frame(2).pixels.at(0), 100);
  EXPECT_EQ(clip.time_s(0), 0);
  EXPECT_DOUBLE_EQ(clip.time_s(2), 8 / 30.0);  // 30 frames a second where nobody tells
  EXPECT_EQ(clip.frame(0).size, (ImageSize{20, 30}));
  EXPECT_EQ(open(R"({"path": "clip", "frame_count": 2, "frame_step": 5})").count(), 2);
}

TEST_F(ClipFramesTest, FramesLeftOutTakeTheirTime) {
  for (const int number : {3, 5, 7, 11}) write_frame(number);  // each 2nd, 9 is missing
  ClipFrames clip = open(R"({"path": "clip", "frames_per_second": 10})");
  ASSERT_EQ(clip.count(), 4);
  EXPECT_EQ(clip.rate_hz(), 10);
  EXPECT_NEAR(clip.time_s(1), 0.1, 1e-12);
  EXPECT_NEAR(clip.time_s(3), 0.4, 1e-12);
}

TEST_F(ClipFramesTest, OfAVideoHaveItsRateAndAreNotCountedFurtherThanAsked) {
  testing::write_counting_video(folder_ / "clip.avi", 20);
  ClipFrames clip =
      open(R"({"path": "clip.avi", "first_frame": 3, "frame_step": 4, "frame_count": 3})");
  ASSERT_EQ(clip.count(), 3);  // 3, 7, 11
  EXPECT_EQ(clip.rate_hz(), 25);
  EXPECT_EQ(clip.number(1), 7);
  EXPECT_DOUBLE_EQ(clip.time_s(2), 8 / 25.0);
  for (const int position : {0, 1, 2}) {
    EXPECT_NEAR(clip.frame(position).pixels.at(0), 2 * (3 + 4 * position), 1);
  }
  EXPECT_EQ(open(R"({"path": "clip.avi", "first_frame": 3, "frame_step": 4})").count(), 5);
  EXPECT_EQ(open(R"({"path": "clip.avi", "first_frame": 3, "frame_step": 8, "frame_count": 3})")
                .number(2),
            19);
  EXPECT_THAT(refusal(R"({"path": "clip.avi", "first_frame": 4, "frame_step": 8,
                          "frame_count": 3})"),
              ::testing::HasSubstr("got 2 of a clip of 20, in"));
}

TEST_F(ClipFramesTest, OfAnUnevenVideoHaveTheirOwnTimesUnlessTheRateIsGiven) {
  testing::write_timed_video(folder_ / "clip.mkv", {0, 100, 600, 700, 1200});
  const ClipFrames clip = open(R"({"path": "clip.mkv", "first_frame": 1})");
  ASSERT_EQ(clip.count(), 4);
  EXPECT_EQ(clip.time_s(0), 0);
  EXPECT_NEAR(clip.time_s(1), 0.5, 1e-9);
  EXPECT_NEAR(clip.time_s(3), 1.1, 1e-9);
  EXPECT_NEAR(open(R"({"path": "clip.mkv", "frames_per_second": 20})").time_s(4), 0.2, 1e-12);
}

TEST_F(ClipFramesTest, ComeAsLargeAsTheSensor) {
  write_frame(0);
  write_frame(1);
  ClipFrames clip = open(R"({"path": "clip"})", R"(, "size": {"width": 16, "height": 17})");
  EXPECT_EQ(clip.frame(1), (GreyImage{{17, 16}, std::vector<std::uint8_t>(17 * 16, 10)}));
}

TEST_F(ClipFramesTest, FilesHashChangesWithTheFiles) {
  for (int i = 0; i < 3; ++i) write_frame(i);
  const std::string before = open(R"({"path": "clip", "frame_count": 2})").files_hash();
  EXPECT_EQ(open(R"({"path": "clip"})").files_hash(), before);
  write_frame(3);
  EXPECT_NE(open(R"({"path": "clip"})").files_hash(), before);
}

TEST_F(ClipFramesTest, RefusesWhatIsNoClipOrTooShort) {
  EXPECT_THAT(refusal(R"({"path": "nowhere"})"), ::testing::HasSubstr("got none, in"));
  write_frame(0);
  EXPECT_THAT(refusal(R"({"path": "clip"})"),
              ::testing::HasSubstr("expected 2 or more frames from frame 0 on in steps of 1, got 1 "
                                   "of a clip of 1, in"));
  EXPECT_EQ(refusal(R"({"path": "clip", "method": "affine"})"), "");
  write_frame(1);
  EXPECT_THAT(refusal(R"({"path": "clip", "frame_count": 3})"), ::testing::HasSubstr("got 2"));
  EXPECT_THAT(refusal(R"({"path": "clip", "first_frame": 7})"), ::testing::HasSubstr("got 0"));
}

TEST_F(ClipFramesTest, RefusesFramesThatCannotBeUsed) {
  write_frame(0);
  write_frame(1, {21, 30});
  testing::write_file(folder_ / "clip/f2.png", "no image");
  ClipFrames clip = open(R"({"path": "clip"})");
  clip.frame(0);
  EXPECT_THROWS(clip.frame(1), InputError, "expected a frame of 30x20 as the first one, got 30x21");
  EXPECT_THROWS(clip.frame(2), InputError, "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM)");
}

class ClipSceneTest : public ::testing::Test {
 protected:
  ClipSceneTest() {
    testing::write_moving_clip(folder_ / "clip", {48, 64}, 3);
    manifest_ = testing::moving_clip_manifest(folder_.path(),
                                              R"({"path": "clip", "frames_per_second": 10})");
    clip_ = std::make_unique<ClipFrames>(manifest_.sources.at(0), manifest_);
  }

  testing::TemporaryFolder folder_;
  SimulationManifest manifest_;
  std::unique_ptr<ClipFrames> clip_;
};

TEST_F(ClipSceneTest, GoesThroughTheFrames) {
  ClipScene scene(*clip_, fade_between);
  EXPECT_FALSE(scene.has_flow());
  EXPECT_EQ(scene.frame(), clip_->frame(0));
  const auto first = scene.advance();
  EXPECT_EQ(scene.frame(), clip_->frame(1));
  EXPECT_DOUBLE_EQ(scene.time_s(), 0.1);
  EXPECT_EQ(first->steps(), 1);
  EXPECT_FLOAT_EQ(first->render(0).at(0) * 255, clip_->frame(0).pixels.at(0));
  EXPECT_NE(scene.advance(), nullptr);
  EXPECT_EQ(scene.advance(), nullptr);
  EXPECT_EQ(scene.frame(), clip_->frame(2));
}

TEST_F(ClipSceneTest, SeesTheSquareMove) {
  ClipScene scene(*clip_);
  EXPECT_TRUE(scene.has_flow());
  const auto interval = scene.advance();
  const FlowDisplacement flow = interval->flow();
  // The square covers x 4..27, y 12..35 and moves 2 px to the right.
  const std::size_t inside = 24 * 64 + 16, outside = 44 * 64 + 56;
  EXPECT_NEAR(flow.x_px.at(inside), 2, 0.5);
  EXPECT_NEAR(flow.y_px.at(inside), 0, 0.5);
  EXPECT_NEAR(flow.x_px.at(outside), 0, 0.5);
}

/// A smooth image, which bilinear interpolation renders well.
GreyImage waves(ImageSize size) {
  GreyImage image{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.pixels.push_back(
          static_cast<std::uint8_t>(std::lround(128 + 60 * std::sin(x / 7.0) * std::cos(y / 5.0))));
    }
  }
  return image;
}

TEST(AffineScene, FramesFollowEachOtherByTheirFlow) {
  const ImageSize size{48, 64};
  const AffineMotion motion = random_affine_motion(size, 11, CounterRandom(3));
  AffineScene scene(waves(size), motion, 4, 0.1);
  EXPECT_EQ(scene.time_s(), 0);
  EXPECT_TRUE(scene.has_flow());
  int intervals = 0;
  for (GreyImage before = scene.frame(); const auto interval = scene.advance();
       before = scene.frame(), ++intervals) {
    // 11 px in 4 parts are at most 2.75 px each: 3 images at most 1 px apart.
    EXPECT_EQ(interval->steps(), 3);
    const FlowDisplacement flow = interval->flow();
    for (int y = 8; y < size.height - 8; ++y) {
      for (int x = 8; x < size.width - 8; ++x) {
        const auto i = static_cast<std::size_t>(y * size.width + x);
        const auto to_x = static_cast<int>(std::lround(x + flow.x_px[i]));
        const auto to_y = static_cast<int>(std::lround(y + flow.y_px[i]));
        const auto j = static_cast<std::size_t>(to_y * size.width + to_x);
        // Half a pixel of rounding times the steepest slope, 60/5 a pixel in both directions.
        EXPECT_NEAR(before.pixels[i], scene.frame().pixels[j], 13);
      }
    }
  }
  EXPECT_EQ(intervals, 3);
  EXPECT_DOUBLE_EQ(scene.time_s(), 0.3);
}

TEST(AffineScene, FlowOfATranslationIsTheSameEverywhere) {
  AffineMotion motion;
  motion.matrix = {1, 0, 6, 0, 1, -3};
  AffineScene scene(waves({20, 30}), motion, 3, 1);
  while (const auto interval = scene.advance()) {
    const FlowDisplacement flow = interval->flow();
    for (const float x : flow.x_px) EXPECT_NEAR(x, 2, 1e-5);
    for (const float y : flow.y_px) EXPECT_NEAR(y, -1, 1e-5);
  }
}

TEST(AffineScene, AnIntervalBeginsAndEndsWithItsFrames) {
  AffineScene scene(waves({20, 30}), random_affine_motion({20, 30}, 5, CounterRandom(1)), 3, 1);
  GreyImage before = scene.frame();
  while (const auto interval = scene.advance()) {
    const std::vector<float> first = interval->render(0);
    const std::vector<float> last = interval->render(interval->steps());
    for (std::size_t i = 0; i < first.size(); ++i) {
      EXPECT_NEAR(first[i] * 255, before.pixels[i], 0.51);
      EXPECT_NEAR(last[i] * 255, scene.frame().pixels[i], 0.51);
    }
    before = scene.frame();
  }
}

}  // namespace
}  // namespace eventgan
