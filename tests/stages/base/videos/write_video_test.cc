#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>

#include "stages/base/videos/video_file.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

ColourFrame plain(ImageSize size, std::uint8_t grey) {
  return {size, std::vector<std::uint8_t>(3 * size.pixel_count(), grey)};
}

TEST(WriteVideo, AVideoHasEveryFrameAndItsSpeed) {
  const testing::TemporaryFolder folder;
  int given = 0;
  const int written = write_video(folder / "v.mp4", 12.5, [&]() -> std::optional<ColourFrame> {
    if (given == 9) return std::nullopt;
    return plain({33, 47}, static_cast<std::uint8_t>(20 * given++));
  });
  EXPECT_EQ(written, 9);
  cv::VideoCapture video((folder / "v.mp4").string(), cv::CAP_FFMPEG);
  ASSERT_TRUE(video.isOpened());
  EXPECT_NEAR(video.get(cv::CAP_PROP_FPS), 12.5, 0.01);
  cv::Mat frame;
  for (int i = 0; i < 9; ++i) {
    ASSERT_TRUE(video.read(frame)) << i;
    EXPECT_EQ(frame.size(), cv::Size(48, 34)) << "H.264 has even sides only";
    EXPECT_NEAR(frame.at<cv::Vec3b>(16, 16)[1], 20 * i, 4);
  }
  EXPECT_FALSE(video.read(frame));
  const auto files = std::filesystem::directory_iterator(folder / ".");
  EXPECT_EQ(std::distance(begin(files), end(files)), 1) << "no temporary is left";
}

TEST(WriteVideo, ErrorsNameThePath) {
  const testing::TemporaryFolder folder;
  const auto grey = [] { return plain({4, 4}, 1); };
  EXPECT_THROWS(write_video(folder / "none/v.mp4", 10, grey), std::runtime_error,
                ::testing::Eq("cannot write " + (folder / "none/v.mp4").string() +
                              ": No such file or directory"));
  EXPECT_THROWS(write_video(folder / "v.mp4", 10, [] { return std::nullopt; }), std::runtime_error,
                "no images");
  int side = 4;
  EXPECT_THROWS(write_video(folder / "v.mp4", 10,
                            [&] {
                              return plain({side++, 4}, 1);
                            }),
                std::runtime_error, "expected images of 4x4, got one of 4x5");
  EXPECT_THAT(testing::names_in(folder.path()), IsEmpty());
}

TEST(WriteVideo, AFullDiskIsToldAndLeavesNothing) {
  const testing::TemporaryFolder folder;
  for (const int frames : {1, 60}) {
    const std::string error = testing::error_on_full_disk(600, [&] {
      int given = 0;
      write_video(folder / "v.mp4", 25, [&]() -> std::optional<ColourFrame> {
        if (given == frames) return std::nullopt;
        return plain({64, 48}, static_cast<std::uint8_t>(97 * given++));
      });
    });
    EXPECT_THAT(error, StartsWith("cannot write " + (folder / "v.mp4").string() + ": "));
    EXPECT_THAT(error, HasSubstr("File too large"));
    EXPECT_THAT(testing::names_in(folder.path()), IsEmpty());
  }
}

}  // namespace
}  // namespace eventgan
