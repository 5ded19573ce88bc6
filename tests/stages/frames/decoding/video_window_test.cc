#include "stages/frames/decoding/video_window.h"

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>
#include <vector>

#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::TemporaryFolder;

/// A window of numbers, as counted, that also notes which frames it was shown.
class VideoWindowTest : public ::testing::Test {
 protected:
  VideoWindowTest() { testing::write_counting_video(clip_, 100); }

  VideoWindow<int> window(int most) {
    return {clip_, most, [this](const ColourView& frame) {
              const int number = testing::counted(
                  ColourFrame{frame.size, {frame.bgr, frame.bgr + 3 * frame.size.pixel_count()}});
              if (unwelcome_.contains(number)) throw std::runtime_error("unwelcome");
              shown_.push_back(number);
              return number;
            }};
  }

  const TemporaryFolder folder_;
  const std::filesystem::path clip_ = folder_ / "clip.avi";
  std::vector<int> shown_;
  std::set<int> unwelcome_;
};

TEST_F(VideoWindowTest, LooksOnlyAtFramesThatStayInTheWindow) {
  auto frames = window(3);
  EXPECT_EQ(frames.frame(50), 50);
  EXPECT_EQ(frames.frame(48), 48);
  EXPECT_EQ(frames.frame(52), 52);
  EXPECT_EQ(frames.frame(99), 99);
  EXPECT_EQ(shown_, (std::vector<int>{48, 49, 50, 51, 52, 97, 98, 99}));
}

TEST_F(VideoWindowTest, AnEarlierFrameOpensTheVideoAnew) {
  auto frames = window(3);
  EXPECT_EQ(frames.frame(50), 50);
  EXPECT_EQ(frames.frame(47), 47);
  EXPECT_EQ(frames.frame(45), 45);
  EXPECT_EQ(frames.frame(46), 46);
}

TEST_F(VideoWindowTest, AFailedOpeningLeavesTheWindowAsItWas) {
  auto frames = window(3);
  EXPECT_EQ(frames.frame(50), 50);
  std::filesystem::remove(clip_);
  EXPECT_THROW(frames.frame(10), std::runtime_error);
  EXPECT_EQ(frames.frame(49), 49);
  EXPECT_EQ(frames.frame(51), 51);
}

TEST_F(VideoWindowTest, AFrameThatCannotBeKeptShiftsNoOther) {
  unwelcome_ = {20};
  auto frames = window(5);
  EXPECT_THROW(frames.frame(21), std::runtime_error);
  EXPECT_EQ(frames.frame(22), 22);
  EXPECT_EQ(frames.frame(21), 21);
  EXPECT_THROW(frames.frame(20), std::runtime_error);
  EXPECT_EQ(frames.frame(19), 19);
}

TEST_F(VideoWindowTest, BeyondTheEndIsRefusedAndTheLastFramesStay) {
  auto frames = window(5);
  EXPECT_THROW(frames.frame(100), std::runtime_error);
  EXPECT_EQ(frames.frame(99), 99);
  EXPECT_EQ(frames.frame(96), 96);
  EXPECT_EQ(shown_, (std::vector<int>{96, 97, 98, 99}));
  EXPECT_THROW(frames.frame(5000), std::runtime_error);
  EXPECT_EQ(frames.frame(99), 99);
}

}  // namespace
}  // namespace eventgan
