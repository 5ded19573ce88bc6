#include "pipeline/simulation/clip_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/picture_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

class ClipFramesTest : public ::testing::Test {
 protected:
  /// Frame i is flat, of value 10 i.
  void write_frame(int number, ImageSize size = {20, 30}) {
    testing::write_flat_picture(folder_ / "clip" / ("f" + std::to_string(number) + ".png"), size,
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
              ::testing::HasSubstr("expected 2 frames or more from frame 0 on by steps of 1, got 1 "
                                   "of a clip of 1, in"));
  EXPECT_EQ(refusal(R"({"path": "clip", "method": "affine"})"), "");
  write_frame(1);
  EXPECT_THAT(refusal(R"({"path": "clip", "frame_count": 3})"), ::testing::HasSubstr("got 2"));
  EXPECT_THAT(refusal(R"({"path": "clip", "first_frame": 7})"), ::testing::HasSubstr("got 0"));
}

TEST_F(ClipFramesTest, RefusesFramesThatCannotBeUsed) {
  write_frame(0);
  write_frame(1, {21, 30});
  testing::write_file(folder_ / "clip/f2.png", "no picture");
  ClipFrames clip = open(R"({"path": "clip"})");
  clip.frame(0);
  EXPECT_THROW(clip.frame(1), InputError);
  EXPECT_THROW(clip.frame(2), InputError);
}

}  // namespace
}  // namespace eventgan
