#include "stages/scenes/layouts/output_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/scenes/picture.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;

TEST(OutputFiles, NumbersHaveZerosInFront) {
  EXPECT_EQ(numbered(7, 3), "007");
  EXPECT_EQ(numbered(0, 1), "0");
  EXPECT_EQ(numbered(12345, 3), "12345");
}

TEST(OutputFiles, WriteAndCopy) {
  const TemporaryFolder folder;
  make_folder(folder / "a/b");
  write_text(folder / "a/b/one.txt", "text");
  copy_output(folder / "a/b/one.txt", folder / "a/two.txt");
  EXPECT_EQ(testing::read_file(folder / "a/two.txt"), "text");
}

TEST(OutputFiles, FailuresNameThePath) {
  const TemporaryFolder folder;
  write_text(folder / "file", "");
  const auto names = [&](const char* name) {
    return ThrowsMessage<std::runtime_error>(HasSubstr((folder / name).string()));
  };
  EXPECT_THAT([&] { write_text(folder / "none/x", "text"); }, names("none/x"));
  EXPECT_THAT([&] { make_folder(folder / "file/x"); }, names("file/x"));
  EXPECT_THAT([&] { copy_output(folder / "none", folder / "x"); }, names("none"));
  EXPECT_THAT(
      [&] {
        write_png(black_picture({2, 2}), folder / "none/x.png");
      },
      names("none/x.png"));
  EXPECT_THAT(
      [&] {
        write_jpeg(black_picture({2, 2}), folder / "none/x.jpg");
      },
      names("none/x.jpg"));
}

}  // namespace
}  // namespace eventgan
