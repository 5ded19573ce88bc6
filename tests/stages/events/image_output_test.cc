#include "stages/events/images/image_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <vector>

#include "manifests/values/counter_random.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Of noise, which compresses worst.
ColourFrame noise(ImageSize size) {
  ColourFrame image{size, std::vector<std::uint8_t>(3 * size.pixel_count())};
  const CounterRandom random(3);
  for (std::size_t i = 0; i < image.bgr.size(); ++i) {
    image.bgr[i] = static_cast<std::uint8_t>(random.bits(i));
  }
  return image;
}

ColourFrame plain(ImageSize size, std::uint8_t grey) {
  return {size, std::vector<std::uint8_t>(3 * size.pixel_count(), grey)};
}

TEST(ImageOutput, APngHasThePixels) {
  const testing::TemporaryFolder folder;
  const ColourFrame image = noise({7, 9});
  write_png(image, folder / "p.png");
  const cv::Mat read = cv::imread((folder / "p.png").string());
  ASSERT_EQ(read.size(), cv::Size(9, 7));
  EXPECT_EQ(std::vector<std::uint8_t>(read.data, read.data + 3 * 63), image.bgr);
}

TEST(ImageOutput, ErrorsNameThePath) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT(
      [&] {
        write_png(plain({4, 4}, 1), folder / "none/p.png");
      },
      ThrowsMessage<std::runtime_error>(HasSubstr((folder / "none").string())));
  EXPECT_THAT([&] { write_video(folder / "none/v.mp4", 10, [] {
                      return plain({4, 4}, 1);
                    }); },
              ThrowsMessage<std::runtime_error>(HasSubstr((folder / "none/v.mp4").string())));
  EXPECT_THAT([&] { write_video(folder / "v.mp4", 10, [] { return std::nullopt; }); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no images")));
}

TEST(ImageOutput, AJpegIsNoLargerThanAsked) {
  const ColourFrame image = noise({200, 300});
  for (const std::size_t most : {200'000, 20'000, 2'000}) {
    const std::string jpeg = jpeg_of(image, most);
    EXPECT_LE(jpeg.size(), most);
    const cv::Mat read = cv::imdecode(
        cv::Mat(1, static_cast<int>(jpeg.size()), CV_8U, const_cast<char*>(jpeg.data())),
        cv::IMREAD_COLOR);
    ASSERT_FALSE(read.empty());
    EXPECT_EQ(read.cols < 300, most < 20'000) << "smaller only if no quality does";
  }
}

TEST(ImageOutput, AVideoHasEveryFrameAndItsSpeed) {
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

}  // namespace
}  // namespace eventgan
