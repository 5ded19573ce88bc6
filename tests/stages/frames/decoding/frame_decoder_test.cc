#include "stages/frames/decoding/frame_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iostream>
#include <opencv2/imgproc.hpp>
#include <string>
#include <thread>
#include <vector>

#include "stages/frames/decoding/picture_file.h"
#include "tests/stages/frames/decoding/test_pictures.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using testing::gradient_picture;
using ::testing::HasSubstr;
using testing::opencv_read;
using testing::same_pixels;
using testing::TemporaryFolder;
using testing::write_file;

FrameRef picture_ref(const std::string& path) {
  FrameRef frame;
  frame.path = path;
  return frame;
}

std::string fault(const Outcome<ColourFrame>& outcome) {
  return is_fault(outcome) ? std::get<SampleFault>(outcome).reason : "no fault";
}

TEST(FrameDecoder, DecodesEveryFormatBelowItsBase) {
  const TemporaryFolder folder;
  const FrameDecoder decoder(folder.path());
  for (const std::string name : {"a.png", "b.jpg", "c.bmp", "d.ppm", "e.tiff", "f.webp"}) {
    ASSERT_TRUE(cv::imwrite((folder / name).string(), gradient_picture({12, 20})));
    const auto outcome = decoder.decode(picture_ref(name));
    ASSERT_EQ(fault(outcome), "no fault");
    EXPECT_TRUE(same_pixels(std::get<ColourFrame>(outcome), opencv_read(folder / name))) << name;
  }
}

TEST(FrameDecoder, ATruncatedWebpIsAFault) {
  const TemporaryFolder folder;
  const FrameDecoder decoder(folder.path());
  for (const int quality : {80, 101}) {  // beyond 100: without loss
    ASSERT_TRUE(cv::imwrite((folder / "a.webp").string(), gradient_picture({120, 160}),
                            {cv::IMWRITE_WEBP_QUALITY, quality}));
    const std::string whole = testing::read_file(folder / "a.webp");
    for (std::size_t length = whole.size() - 1; length > 0; length = length * 9 / 10) {
      write_file(folder / "a.webp", whole.substr(0, length));
      EXPECT_NE(fault(decoder.decode(picture_ref("a.webp"))), "no fault")
          << length << " of " << whole.size() << " bytes, quality " << quality;
    }
  }
}

TEST(FrameDecoder, FormatIsToldByContentNotByName) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.png").string(), gradient_picture({12, 20}));
  std::filesystem::rename(folder / "a.png", folder / "a.jpg");
  EXPECT_EQ(fault(FrameDecoder(folder.path()).decode(picture_ref("a.jpg"))), "no fault");
}

TEST(FrameDecoder, FaultsSayWhatIsWrongAndNameTheFile) {
  const TemporaryFolder folder;
  const FrameDecoder decoder(folder.path());
  write_file(folder / "sub/empty.png", "");
  write_file(folder / "text.png", "This is no picture.\n");
  write_file(folder / "short.jpg", "\xff\xd8\xff");
  std::filesystem::create_directory(folder / "folder.png");
  cv::imwrite((folder / "cut.bmp").string(), gradient_picture({12, 20}));
  std::filesystem::resize_file(folder / "cut.bmp", 300);

  EXPECT_EQ(fault(decoder.decode(picture_ref("sub/empty.png"))),
            "expected a picture, got an empty file, in sub/empty.png");
  EXPECT_EQ(fault(decoder.decode(picture_ref("none.png"))),
            "expected a file, got none, in none.png");
  EXPECT_EQ(fault(decoder.decode(picture_ref("text.png"))),
            "expected a picture, got a file of another kind, in text.png");
  EXPECT_EQ(fault(decoder.decode(picture_ref("folder.png"))),
            "expected a file, got a folder or device, in folder.png");
  EXPECT_THAT(fault(decoder.decode(picture_ref("short.jpg"))),
              AllOf(HasSubstr("expected a whole JPEG, got "), HasSubstr(", in short.jpg")));
  EXPECT_EQ(fault(decoder.decode(picture_ref("cut.bmp"))),
            "expected a whole picture, got a damaged one, in cut.bmp");
}

TEST(FrameDecoder, OpencvTellsNobodyElseWhatIsWrong) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "cut.bmp").string(), gradient_picture({12, 20}));
  std::filesystem::resize_file(folder / "cut.bmp", 300);
  silence_decoders();
  ::testing::internal::CaptureStderr();
  const std::string reason = fault(FrameDecoder(folder.path()).decode(picture_ref("cut.bmp")));
  std::cerr << "from us\n";
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "from us\n");
  EXPECT_THAT(reason, HasSubstr("got a damaged one"));
}

TEST(FrameDecoder, VideoFramesAreFoundByCountingInAnyOrder) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 100);
  const FrameDecoder decoder(folder.path(), 6);
  // Forward, within the kept frames, far back (opens anew), the last one.
  for (const int position : {0, 5, 3, 80, 75, 0, 99}) {
    const auto outcome = decoder.decode(testing::video_ref("clip.avi", position));
    ASSERT_EQ(fault(outcome), "no fault");
    EXPECT_EQ(testing::counted(std::get<ColourFrame>(outcome)), position);
  }
}

TEST(FrameDecoder, KeepsAsManyFramesAsToldAndOpensAnewForEarlierOnes) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 100);
  const FrameDecoder decoder(folder.path(), 70);
  ASSERT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 99))), "no fault");
  // The open video outlives its name; opening it anew fails.
  std::filesystem::remove(folder / "clip.avi");
  for (const int position : {30, 99, 31}) {  // the latest 70 are 30..99
    const auto outcome = decoder.decode(testing::video_ref("clip.avi", position));
    ASSERT_EQ(fault(outcome), "no fault");
    EXPECT_EQ(testing::counted(std::get<ColourFrame>(outcome)), position);
  }
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 29))),
            "expected a file, got none, in clip.avi");
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
      EXPECT_EQ(testing::counted(std::get<ColourFrame>(outcome)), position) << name;
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
        wrong[worker] +=
            is_fault(outcome) || testing::counted(std::get<ColourFrame>(outcome)) != position;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

TEST(FrameDecoder, VideoFaults) {
  const TemporaryFolder folder;
  testing::write_counting_video(folder / "clip.avi", 10);
  write_file(folder / "words.txt", "FFmpeg would draw these words as a picture.\n");
  const FrameDecoder decoder(folder.path());

  EXPECT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 10))),
            "expected a frame at position 10, got a video whose frames end after 10, in clip.avi");
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("clip.avi", 9))), "no fault")
      << "the frames before the end are still there";
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("none.mp4", 0))),
            "expected a file, got none, in none.mp4");
  EXPECT_EQ(fault(decoder.decode(testing::video_ref("words.txt", 0))),
            "expected a video, got a file that cannot be read as one, in words.txt");
}

}  // namespace
}  // namespace eventgan
