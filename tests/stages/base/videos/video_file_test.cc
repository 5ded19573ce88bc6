#include "stages/base/videos/video_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>

#include "manifests/values/counter_random.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using testing::TemporaryFolder;

/// A video of moving shades; all codecs that OpenCV finds here are compared.
bool write_shades(const std::filesystem::path& path, const char* codec, cv::Size size) {
  cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG,
                         cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]), 25, size);
  if (!writer.isOpened()) return false;
  for (int i = 0; i < 9; ++i) {
    cv::Mat image(size, CV_8UC3);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        image.at<cv::Vec3b>(y, x) = cv::Vec3b(static_cast<std::uint8_t>(7 * x + 9 * i),
                                              static_cast<std::uint8_t>(5 * y - 4 * i),
                                              static_cast<std::uint8_t>(3 * (x + y)));
      }
    }
    writer.write(image);
  }
  return true;
}

cv::Mat pixels(const ColourView& frame) {
  return cv::Mat(frame.size.height, frame.size.width, CV_8UC3,
                 const_cast<std::uint8_t*>(frame.bgr));
}

/// How many frames are the same, if all are.
int same_frames(const std::filesystem::path& path) {
  cv::VideoCapture theirs(path.string(), cv::CAP_FFMPEG);
  VideoFile ours(path);
  cv::Mat expected;
  int frames = 0;
  for (; theirs.read(expected); ++frames) {
    const auto frame = ours.next();
    if (!frame) return -1;
    const cv::Mat view = pixels(*frame);
    if (view.size() != expected.size() || cv::norm(view, expected, cv::NORM_INF) != 0) return -1;
  }
  return ours.next() ? -1 : frames;
}

TEST(VideoFile, FramesAreThoseThatOpenCvReads) {
  const TemporaryFolder folder;
  int written = 0;
  for (const char* name : {"MJPG.avi", "mp4v.mp4", "avc1.mp4", "FFV1.avi", "XVID.avi"}) {
    for (const cv::Size size : {cv::Size(64, 48), cv::Size(50, 38), cv::Size(162, 94)}) {
      if (!write_shades(folder / name, name, size)) continue;
      EXPECT_EQ(same_frames(folder / name), 9) << name << ' ' << size;
      ++written;
    }
  }
  EXPECT_GE(written, 6);
}

TEST(VideoFile, RealFramesEqualOpenCv) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  EXPECT_EQ(same_frames(data / "human36m_official/S1/Videos/Directions 1.54138969.mp4"), 40);
}

TEST(VideoFile, SaysWhatTheContainerSays) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "v.avi", 12, 20);
  VideoFile video(folder / "v.avi");
  EXPECT_EQ(video.announced_count(), 12);
  EXPECT_EQ(video.frames_per_second(), 20);
  for (int i = 0; i < 12; ++i) {
    ASSERT_TRUE(i % 2 == 0 ? video.skip() : video.next().has_value());
    EXPECT_NEAR(video.time_s(), i / 20.0, 1e-9);
    EXPECT_EQ(video.position(), i + 1);
  }
  EXPECT_FALSE(video.skip());
  EXPECT_FALSE(video.next());
}

// The matrix of the header of an MP4's track (ISO 14496-12 section 8.3.2), in fixed point.
TEST(VideoFile, IsTurnedAsTheFileSays) {
  const TemporaryFolder folder;
  if (!write_shades(folder / "v.mp4", "mp4v", {64, 48}))
    GTEST_SKIP() << "skipped: no MPEG-4 encoder";
  const std::string whole = testing::read_file(folder / "v.mp4");
  const std::size_t matrix = whole.find("tkhd") + 4 + 40;
  const auto number = [](int value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
    return bytes;
  };
  const int one = 1 << 16;
  ASSERT_EQ(whole.substr(matrix, 8), number(one) + number(0));
  struct Turn {
    int right;  // to where a step to the right leads: so much to the right,
    int down;   // and so much down
    cv::RotateFlags expected;
  };
  for (const auto& [right, down, expected] : {Turn{0, one, cv::ROTATE_90_CLOCKWISE},
                                              {-one, 0, cv::ROTATE_180},
                                              {0, -one, cv::ROTATE_90_COUNTERCLOCKWISE}}) {
    std::string turned = whole;
    turned.replace(
        matrix, 24,
        number(right) + number(down) + number(0) + number(-down) + number(right) + number(0));
    testing::write_file(folder / "turned.mp4", turned);
    VideoFile stored(folder / "v.mp4");
    VideoFile shown(folder / "turned.mp4");
    for (int i = 0; i < 9; ++i) {
      cv::Mat image;
      cv::rotate(pixels(*stored.next()), image, expected);
      const auto frame = shown.next();
      ASSERT_TRUE(frame);
      ASSERT_EQ(pixels(*frame).size(), image.size());
      EXPECT_EQ(cv::norm(pixels(*frame), image, cv::NORM_INF), 0);
    }
  }
}

TEST(VideoFile, DamageEndsOrChangesAVideoAndTellsNobodyElse) {
  const TemporaryFolder folder;
  std::uint64_t counter = 0;
  const CounterRandom random(5);
  for (const char* name : {"MJPG.avi", "mp4v.mp4", "avc1.mp4"}) {
    if (!write_shades(folder / name, name, {64, 48})) continue;
    const std::string whole = testing::read_file(folder / name);
    for (int i = 0; i < 40; ++i) {
      std::string damaged =
          whole.substr(0, i % 4 == 0 ? random.bits(counter++) % whole.size() : whole.size());
      for (int change = 0; change < 20 && !damaged.empty(); ++change) {
        const std::size_t at = random.bits(counter++) % damaged.size();
        damaged[at] = static_cast<char>(random.bits(counter++));
      }
      testing::write_file(folder / "damaged", damaged);
      ::testing::internal::CaptureStderr();
      try {
        VideoFile video(folder / "damaged");
        for (int frame = 0; frame < 100 && video.next(); ++frame) {
        }
      } catch (const std::runtime_error&) {
      }
      EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
    }
  }
}

TEST(VideoFile, ANameIsNoAddress) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "v.avi", 3);
  std::filesystem::rename(folder / "v.avi", folder / "concat:v.avi");
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  EXPECT_TRUE(VideoFile("concat:v.avi").skip());
  std::filesystem::current_path(before);
}

}  // namespace
}  // namespace eventgan
