#include "stages/frames/decoding/image_size_probe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/stages/frames/decoding/test_pictures.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::EndsWith;
using testing::gradient_picture;
using ::testing::StartsWith;
using testing::TemporaryFolder;
using testing::write_file;

TEST(ImageSizeProbe, PicturesAndVideos) {
  const TemporaryFolder folder;
  for (const std::string name : {"a.png", "b.jpg", "c.bmp"}) {
    cv::imwrite((folder / name).string(), gradient_picture({31, 57}));
    EXPECT_EQ(std::get<ImageSize>(probe_image_size(folder / name)), (ImageSize{31, 57})) << name;
  }
  testing::write_counting_video(folder / "clip.avi", 3);
  EXPECT_EQ(std::get<ImageSize>(probe_image_size(folder / "clip.avi")), (ImageSize{48, 64}));
}

TEST(ImageSizeProbe, ReadsOnlyTheHeader) {
  const TemporaryFolder folder;
  for (const std::string name : {"a.png", "b.jpg"}) {
    cv::imwrite((folder / name).string(), gradient_picture({120, 160}));
    const auto size = std::filesystem::file_size(folder / name);
    std::filesystem::resize_file(folder / name, size * 3 / 4);
    EXPECT_EQ(std::get<ImageSize>(probe_image_size(folder / name)), (ImageSize{120, 160})) << name;
  }
}

TEST(ImageSizeProbe, FaultsNameTheFile) {
  const TemporaryFolder folder;
  write_file(folder / "empty.png", "");
  write_file(folder / "words.txt", "no picture");
  write_file(folder / "zeros.mp4", std::string(4096, '\0'));
  for (const std::string name : {"empty.png", "words.txt", "zeros.mp4", "none.jpg"}) {
    const auto outcome = probe_image_size(folder / name);
    ASSERT_TRUE(is_fault(outcome)) << name;
    EXPECT_THAT(std::get<SampleFault>(outcome).reason, StartsWith("expected a "));
    EXPECT_THAT(std::get<SampleFault>(outcome).reason,
                EndsWith(", in " + (folder / name).string()));
  }
}

}  // namespace
}  // namespace eventgan
