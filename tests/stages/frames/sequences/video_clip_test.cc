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

TEST(VideoClip, RefusesWhatIsNoVideo) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(measure_video(folder / "none.avi"), InputError);
  testing::write_file(folder / "words.avi", "words");
  EXPECT_THROW(measure_video(folder / "words.avi", 1), InputError);
}

}  // namespace
}  // namespace eventgan
