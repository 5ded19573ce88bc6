#include "stages/frames/decoding/frame_decoder.h"

#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <thread>

#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/video_frames.h"
#include "tests/stages/base/images/test_images.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

using testing::gradient_image;
using testing::opencv_read;
using testing::same_pixels;

TEST(ImageSizeProbe, ImagesAndVideos) {
  const TemporaryFolder folder;
  for (const std::string name : {"a.png", "b.jpg", "c.bmp"}) {
    cv::imwrite((folder / name).string(), gradient_image({31, 57}));
    EXPECT_EQ(*probe_image_size(folder / name, ImageOrientation::kStored), (ImageSize{31, 57}))
        << name;
  }
  testing::write_counting_video(folder / "clip.avi", 3);
  EXPECT_EQ(*probe_image_size(folder / "clip.avi", ImageOrientation::kStored), (ImageSize{48, 64}));
}

TEST(ImageSizeProbe, ReadsOnlyTheHeader) {
  const TemporaryFolder folder;
  for (const std::string name : {"a.png", "b.jpg"}) {
    cv::imwrite((folder / name).string(), gradient_image({120, 160}));
    const auto size = fs::file_size(folder / name);
    fs::resize_file(folder / name, size * 3 / 4);
    EXPECT_EQ(*probe_image_size(folder / name, ImageOrientation::kStored), (ImageSize{120, 160}))
        << name;
  }
}

TEST(ImageSizeProbe, FaultsNameTheFile) {
  const TemporaryFolder folder;
  write_file(folder / "empty.png", "");
  write_file(folder / "words.txt", "no image");
  write_file(folder / "zeros.mp4", std::string(4096, '\0'));
  for (const std::string name : {"empty.png", "words.txt", "zeros.mp4", "none.jpg"}) {
    const auto outcome = probe_image_size(folder / name, ImageOrientation::kStored);
    EXPECT_THAT(fault_of(outcome), StartsWith("expected a"));
    EXPECT_THAT(outcome.fault().reason, EndsWith(", in " + (folder / name).string()));
  }
}

FrameRef image_ref(const std::string& path) {
  FrameRef frame;
  frame.path = path;
  return frame;
}

std::string fault(const Outcome<ColourFrame>& outcome) {
  return is_fault(outcome) ? outcome.fault().reason : "no fault";
}

TEST(FrameDecoder, DecodesEveryFormatBelowItsBase) {
  const TemporaryFolder folder;
  const FrameDecoder decoder(folder.path());
  for (const std::string name : {"a.png", "b.jpg", "c.bmp", "d.ppm", "e.tiff", "f.webp"}) {
    ASSERT_TRUE(cv::imwrite((folder / name).string(), gradient_image({12, 20})));
    const auto outcome = decoder.decode(image_ref(name));
    ASSERT_EQ(fault(outcome), "no fault");
    EXPECT_TRUE(same_pixels(*outcome, opencv_read(folder / name))) << name;
  }
}

TEST(FrameDecoder, TurnsImagesWhereItIsAskedTo) {
  const TemporaryFolder folder;
  const FrameDecoder decoder(folder.path());
  const auto file = folder / "a.jpg";
  cv::imwrite(file.string(), gradient_image({12, 20}));
  write_file(file, testing::with_orientation(read_file(file), 8));
  EXPECT_EQ(*probe_image_size(file, ImageOrientation::kStored), (ImageSize{12, 20}));
  EXPECT_EQ(*probe_image_size(file, ImageOrientation::kUpright), (ImageSize{20, 12}));
  EXPECT_TRUE(same_pixels(*decoder.decode(image_ref("a.jpg")), opencv_read(file)));
  const auto upright = decoder.decode(image_ref("a.jpg"), 1, ImageOrientation::kUpright);
  EXPECT_TRUE(same_pixels(*upright, cv::imread(file.string())));
  write_file(file, testing::with_orientation(read_file(file), 5));
  EXPECT_EQ(fault(decoder.decode(image_ref("a.jpg"), 1, ImageOrientation::kUpright)),
            "expected an image that is not mirrored, got EXIF orientation 5, in a.jpg");
  EXPECT_EQ(fault_of(probe_image_size(file, ImageOrientation::kUpright)),
            "expected an image that is not mirrored, got EXIF orientation 5, in " + file.string());
  EXPECT_EQ(orientation_of(DatasetKind::kFrames), ImageOrientation::kUpright);
  EXPECT_EQ(orientation_of(DatasetKind::kMpii), ImageOrientation::kStored);
}

TEST(FrameDecoder, FormatIsToldByContentNotByName) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(), gradient_image({12, 20}));
  fs::rename(folder / "a.png", folder / "a.jpg");
  EXPECT_EQ(fault(FrameDecoder(folder.path()).decode(image_ref("a.jpg"))), "no fault");
}

TEST(FrameDecoder, FaultsSayWhatIsWrongAndNameTheFile) {
  const TemporaryFolder folder;
  const FrameDecoder decoder(folder.path());
  write_file(folder / "sub/empty.png", "");
  write_file(folder / "text.png", "This is no image.\n");
  write_file(folder / "short.jpg", "\xff\xd8\xff");
  fs::create_directory(folder / "folder.png");
  cv::imwrite((folder / "cut.bmp").string(), gradient_image({12, 20}));
  fs::resize_file(folder / "cut.bmp", 300);

  EXPECT_EQ(fault(decoder.decode(image_ref("sub/empty.png"))),
            "expected an image, got an empty file, in sub/empty.png");
  EXPECT_EQ(fault(decoder.decode(image_ref("none.png"))),
            "expected a readable file, got 'No such file or directory', in none.png");
  EXPECT_EQ(fault(decoder.decode(image_ref("text.png"))),
            "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM), got a file of another kind, in "
            "text.png");
  EXPECT_EQ(fault(decoder.decode(image_ref("folder.png"))),
            "expected a readable file, got 'Is a directory', in folder.png");
  EXPECT_THAT(fault(decoder.decode(image_ref("short.jpg"))),
              AllOf(HasSubstr("expected a whole JPEG, got "), HasSubstr(", in short.jpg")));
  EXPECT_EQ(fault(decoder.decode(image_ref("cut.bmp"))),
            "expected a whole BMP, got one that ends early, in cut.bmp");
}

TEST(FrameDecoder, VideoFramesAreFoundByCountingInAnyOrder) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 100);
  const FrameDecoder decoder(folder.path(), 6);
  // Forward, within the kept frames, far back (opens again), the last one.
  for (const int position : {0, 5, 3, 80, 75, 0, 99}) {
    const auto outcome = decoder.decode(testing::video_ref("clip.avi", position));
    ASSERT_EQ(fault(outcome), "no fault");
    EXPECT_EQ(testing::counted(*outcome), position);
  }
}

TEST(FrameDecoder, KeepsAsManyFramesAsToldAndOpensAnewForEarlierOnes) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 100);
  const FrameDecoder decoder(folder.path(), 70);
  ASSERT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 99))), "no fault");
  // The open video outlives its name; opening it again fails.
  fs::remove(folder / "clip.avi");
  for (const int position : {30, 99, 31}) {  // the latest 70 are 30..99
    const auto outcome = decoder.decode(testing::video_ref("clip.avi", position));
    ASSERT_EQ(fault(outcome), "no fault");
    EXPECT_EQ(testing::counted(*outcome), position);
  }
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 29))),
            "expected a readable file, got 'No such file or directory', in clip.avi");
}

TEST(FrameDecoder, SeveralVideosByTurns) {
  const TemporaryFolder folder;
  const FrameDecoder decoder(folder.path());
  const std::vector<std::string> names{"a.avi", "b.avi", "c.avi"};
  for (const auto& name : names) testing::write_counting_video(folder / name, 10);
  for (const int position : {1, 4, 2}) {
    for (const auto& name : names) {
      const auto outcome = decoder.decode(testing::video_ref(name, position));
      ASSERT_EQ(fault(outcome), "no fault");
      EXPECT_EQ(testing::counted(*outcome), position) << name;
    }
  }
}

TEST(FrameDecoder, SeveralThreadsReadOneVideo) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 40);
  const FrameDecoder decoder(folder.path());
  std::vector<int> wrong(4, 0);
  std::vector<std::thread> threads;
  for (int worker = 0; worker < 4; ++worker) {
    threads.emplace_back([&, worker] {
      for (int position = worker; position < 40; position += 4) {
        const auto outcome = decoder.decode(testing::video_ref("clip.avi", position));
        wrong[worker] += is_fault(outcome) || testing::counted(*outcome) != position;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

TEST(FrameDecoder, VideoFaults) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 10);
  write_file(folder / "words.txt", "FFmpeg would draw these words as an image.\n");
  const FrameDecoder decoder(folder.path());

  EXPECT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 10))),
            "expected a frame at position 10, got a video whose frames end after 10, in clip.avi");
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 9))), "no fault")
      << "the frames before the end are still there";
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("none.mp4", 0))),
            "expected a readable file, got 'No such file or directory', in none.mp4");
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("words.txt", 0))),
            "expected a video, got a file that cannot be read as one, in words.txt");
}

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
  const fs::path clip_ = folder_ / "clip.avi";
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
  fs::remove(clip_);
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
