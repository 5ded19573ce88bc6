#include "stages/frames/sequences/video_clip.h"

#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(VideoClip, CountsToTheEndOrAsFarAsIsEnough) {
  const testing::TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 12);
  const VideoClip whole = measure_video(folder / "clip.avi");
  EXPECT_EQ(whole.frame_count, 12);
  EXPECT_EQ(whole.frames_per_second, 25);
  const VideoClip part = measure_video(folder / "clip.avi", 5);
  EXPECT_EQ(part.frame_count, 5);
  EXPECT_EQ(part.frames_per_second, 25);
  EXPECT_EQ(part.announced_count, whole.announced_count);
  EXPECT_EQ(measure_video(folder / "clip.avi", 13).frame_count, 12);
}

TEST(VideoClip, KeepsTheTimesOfFramesThatComeUnevenly) {
  const testing::TemporaryFolder folder;
  testing::write_timed_video(folder / "clip.mkv", {40, 140, 640, 740, 1240, 1340});
  const VideoClip clip = measure_video(folder / "clip.mkv");
  EXPECT_EQ(clip.frame_count, 6);
  const double expected[] = {0, 0.1, 0.6, 0.7, 1.2, 1.3};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(clip.time_s(i), expected[i], 1e-9);
  EXPECT_NEAR(measure_video(folder / "clip.mkv", 3).time_s(2), 0.6, 1e-9);
}

TEST(VideoClip, TimesRoundedToMillisecondsAreThoseOfTheRate) {
  const testing::TemporaryFolder folder;
  std::vector<int> thirds;  // 30 Hz, as Matroska has it
  for (int i = 0; i < 31; ++i) thirds.push_back((i * 1000 + 15) / 30);
  testing::write_timed_video(folder / "clip.mkv", thirds);
  const VideoClip clip = measure_video(folder / "clip.mkv");
  EXPECT_TRUE(clip.uneven_times_s.empty());
  EXPECT_DOUBLE_EQ(clip.time_s(10), 10 / *clip.frames_per_second);
  EXPECT_NEAR(clip.time_s(30), 1, 2e-3);
}

TEST(VideoClip, TimesThatDoNotAscendAreNotTaken) {
  const testing::TemporaryFolder folder;
  testing::write_timed_video(folder / "clip.mkv", {0, 100, 100, 100, 500});
  const VideoClip clip = measure_video(folder / "clip.mkv");
  EXPECT_TRUE(clip.uneven_times_s.empty());
  EXPECT_FALSE(clip.times_ascend);
}

TEST(VideoClip, RefusesWhatIsNoVideo) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(measure_video(folder / "none.avi"), InputError);
  testing::write_file(folder / "words.avi", "words");
  EXPECT_THROW(measure_video(folder / "words.avi", 1), InputError);
}

}  // namespace
}  // namespace eventgan
