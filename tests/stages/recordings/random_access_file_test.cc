#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "stages/recordings/random_access_file_internal.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class RandomAccessFileTest : public ::testing::Test {
 protected:
  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "file";
};

TEST_F(RandomAccessFileTest, ReadsParts) {
  testing::write_file(path_, "0123456789");
  const RandomAccessFile file(path_);
  EXPECT_EQ(file.size_bytes(), 10);
  EXPECT_EQ(file.read(3, 6), "345");
  EXPECT_EQ(file.read(0, 10), "0123456789");
  EXPECT_EQ(file.read(10, 10), "");
}

TEST_F(RandomAccessFileTest, RefusesWhatIsNoFile) {
  EXPECT_THAT(
      [&] { RandomAccessFile file(path_); },
      ThrowsMessage<InputError>(HasSubstr("No such file or directory, in " + path_.string())));
  EXPECT_THAT([&] { RandomAccessFile file(folder_.path()); },
              ThrowsMessage<InputError>(HasSubstr("a folder or device")));
}

TEST_F(RandomAccessFileTest, TellsOfAFileThatShrinks) {
  testing::write_file(path_, "0123456789");
  const RandomAccessFile file(path_);
  std::filesystem::resize_file(path_, 5);
  EXPECT_EQ(file.read(0, 5), "01234");
  EXPECT_THAT([&] { file.read(0, 10); }, ThrowsMessage<InputError>(HasSubstr("has shrunk")));
}

}  // namespace
}  // namespace eventgan
