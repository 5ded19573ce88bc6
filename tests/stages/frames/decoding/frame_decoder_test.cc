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

class FrameDecoderTest : public FolderTest {
 protected:
  std::string fault(const std::string& name) const {
    return fault_of(decoder_.decode(image_ref(name)));
  }
  static std::string fault(const FrameDecoder& decoder, const std::string& video, int position) {
    return fault_of(decoder.decode(testing::video_ref(video, position)));
  }
  /// The number of the frame that the decoder gives for this one.
  static int number(const FrameDecoder& decoder, const std::string& video, int position) {
    const auto outcome = decoder.decode(testing::video_ref(video, position));
    EXPECT_EQ(fault_of(outcome), "no fault");
    return is_fault(outcome) ? -1 : testing::counted(*outcome);
  }
  void video(const std::string& name, int frames) const {
    testing::write_counting_video(at(name), frames);
  }
  void gradient(const std::string& name) const {
    ASSERT_TRUE(cv::imwrite(at(name).string(), gradient_image({12, 20})));
  }

  const FrameDecoder decoder_{folder_.path()};
};

TEST_F(FrameDecoderTest, DecodesEveryFormatBelowItsBase) {
  for (const char* name : {"a.png", "b.jpg", "c.bmp", "d.ppm", "e.tiff", "f.webp"}) {
    gradient(name);
    ASSERT_EQ(fault(name), "no fault");
    EXPECT_TRUE(same_pixels(*decoder_.decode(image_ref(name)), opencv_read(at(name)))) << name;
  }
}

TEST_F(FrameDecoderTest, TurnsImagesWhereItIsAskedTo) {
  const fs::path file = at("a.jpg");
  gradient("a.jpg");
  write_file(file, testing::with_orientation(read_file(file), 8));
  EXPECT_EQ(*probe_image_size(file, ImageOrientation::kStored), (ImageSize{12, 20}));
  EXPECT_EQ(*probe_image_size(file, ImageOrientation::kUpright), (ImageSize{20, 12}));
  EXPECT_TRUE(same_pixels(*decoder_.decode(image_ref("a.jpg")), opencv_read(file)));
  const auto upright = decoder_.decode(image_ref("a.jpg"), 1, ImageOrientation::kUpright);
  EXPECT_TRUE(same_pixels(*upright, cv::imread(file.string())));
  write_file(file, testing::with_orientation(read_file(file), 5));
  const std::string mirrored =
      "expected an image that is not mirrored, got EXIF orientation 5, in ";
  EXPECT_EQ(fault_of(decoder_.decode(image_ref("a.jpg"), 1, ImageOrientation::kUpright)),
            mirrored + "a.jpg");
  EXPECT_EQ(fault_of(probe_image_size(file, ImageOrientation::kUpright)), mirrored + file.string());
  EXPECT_EQ(orientation_of(DatasetKind::kFrames), ImageOrientation::kUpright);
  EXPECT_EQ(orientation_of(DatasetKind::kMpii), ImageOrientation::kStored);
}

TEST_F(FrameDecoderTest, FormatIsToldByContentNotByName) {
  gradient("a.png");
  fs::rename(at("a.png"), at("a.jpg"));
  EXPECT_EQ(fault("a.jpg"), "no fault");
}

TEST_F(FrameDecoderTest, FaultsSayWhatIsWrongAndNameTheFile) {
  write("sub/empty.png");
  write("text.png", "This is no image.\n");
  write("short.jpg", "\xff\xd8\xff");
  fs::create_directory(at("folder.png"));
  gradient("cut.bmp");
  fs::resize_file(at("cut.bmp"), 300);
  for (const auto& [name, expected] :
       {std::pair("sub/empty.png"s, "expected an image, got an empty file"s),
        {"none.png", "expected a readable file, got 'No such file or directory'"},
        {"text.png",
         "expected an image (JPEG, PNG, WebP, TIFF, BMP or PNM), got a file of another "
         "kind"},
        {"folder.png", "expected a readable file, got 'Is a directory'"},
        {"cut.bmp", "expected a whole BMP, got one that ends early"}}) {
    EXPECT_EQ(fault(name), expected + ", in " + name);
  }
  EXPECT_THAT(fault("short.jpg"),
              AllOf(HasSubstr("expected a whole JPEG, got "), HasSubstr(", in short.jpg")));
}

TEST_F(FrameDecoderTest, VideoFramesAreFoundByCountingInAnyOrder) {
  video("clip.avi", 100);
  const FrameDecoder decoder(folder_.path(), 6);
  // Forward, within the kept frames, far back (opens again), the last one.
  for (const int position : {0, 5, 3, 80, 75, 0, 99}) {
    EXPECT_EQ(number(decoder, "clip.avi", position), position);
  }
}

TEST_F(FrameDecoderTest, KeepsAsManyFramesAsToldAndOpensAnewForEarlierOnes) {
  video("clip.avi", 100);
  const FrameDecoder decoder(folder_.path(), 70);
  ASSERT_EQ(fault(decoder, "clip.avi", 99), "no fault");
  // The open video outlives its name; opening it again fails.
  fs::remove(at("clip.avi"));
  for (const int position : {30, 99, 31}) {  // the latest 70 are 30..99
    EXPECT_EQ(number(decoder, "clip.avi", position), position);
  }
  EXPECT_EQ(fault(decoder, "clip.avi", 29),
            "expected a readable file, got 'No such file or directory', in clip.avi");
}

TEST_F(FrameDecoderTest, SeveralVideosByTurns) {
  const Texts names{"a.avi", "b.avi", "c.avi"};
  for (const std::string& name : names) video(name, 10);
  for (const int position : {1, 4, 2}) {
    for (const std::string& name : names) EXPECT_EQ(number(decoder_, name, position), position);
  }
}

TEST_F(FrameDecoderTest, SeveralThreadsReadOneVideo) {
  video("clip.avi", 40);
  std::vector<int> wrong(4, 0);
  std::vector<std::thread> threads;
  for (int worker = 0; worker < 4; ++worker) {
    threads.emplace_back([&, worker] {
      for (int position = worker; position < 40; position += 4) {
        const auto outcome = decoder_.decode(testing::video_ref("clip.avi", position));
        wrong[worker] += is_fault(outcome) || testing::counted(*outcome) != position;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

TEST_F(FrameDecoderTest, VideoFaults) {
  video("clip.avi", 10);
  write("words.txt", "FFmpeg would draw these words as an image.\n");
  const std::tuple<const char*, int, const char*> cases[] = {
      {"clip.avi", 10,
       "expected a frame at position 10, got a video whose frames end after 10, in clip.avi"},
      {"clip.avi", 9, "no fault"},  // the frames before the end are still there
      {"none.mp4", 0, "expected a readable file, got 'No such file or directory', in none.mp4"},
      {"words.txt", 0, "expected a video, got a file that cannot be read as one, in words.txt"}};
  for (const auto& [name, position, expected] : cases) {
    EXPECT_EQ(fault(decoder_, name, position), expected);
  }
}

/// A window of numbers, as counted, that also notes which frames it was shown.
class VideoWindowTest : public FolderTest {
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
  /// Asks for these frames one after the other.
  static void expect_frames(VideoWindow<int>& frames, const std::vector<int>& numbers) {
    for (const int number : numbers) EXPECT_EQ(frames.frame(number), number);
  }

  const fs::path clip_ = at("clip.avi");
  std::vector<int> shown_;
  std::set<int> unwelcome_;
};

TEST_F(VideoWindowTest, LooksOnlyAtFramesThatStayInTheWindow) {
  auto frames = window(3);
  expect_frames(frames, {50, 48, 52, 99});
  EXPECT_EQ(shown_, (std::vector<int>{48, 49, 50, 51, 52, 97, 98, 99}));
}

TEST_F(VideoWindowTest, AnEarlierFrameOpensTheVideoAnew) {
  auto frames = window(3);
  expect_frames(frames, {50, 47, 45, 46});
}

TEST_F(VideoWindowTest, AFailedOpeningLeavesTheWindowAsItWas) {
  auto frames = window(3);
  expect_frames(frames, {50});
  fs::remove(clip_);
  EXPECT_THROWS(frames.frame(10), std::runtime_error, "No such file or directory");
  expect_frames(frames, {49, 51});
}

TEST_F(VideoWindowTest, AFrameThatCannotBeKeptShiftsNoOther) {
  unwelcome_ = {20};
  auto frames = window(5);
  EXPECT_THROWS(frames.frame(21), std::runtime_error, "unwelcome");
  expect_frames(frames, {22, 21});
  EXPECT_THROWS(frames.frame(20), std::runtime_error, "unwelcome");
  expect_frames(frames, {19});
}

TEST_F(VideoWindowTest, BeyondTheEndIsRefusedAndTheLastFramesStay) {
  auto frames = window(5);
  EXPECT_THROWS(frames.frame(100), std::runtime_error, "a video whose frames end after 100");
  expect_frames(frames, {99, 96});
  EXPECT_EQ(shown_, (std::vector<int>{96, 97, 98, 99}));
  EXPECT_THROWS(frames.frame(5000), std::runtime_error, "a video whose frames end after 100");
  expect_frames(frames, {99});
}

}  // namespace
}  // namespace eventgan
