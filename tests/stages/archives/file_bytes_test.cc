#include "stages/archives/file_bytes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(FileBytes, ReadsParts) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abcdef");
  const FileBytes file(folder / "f");
  EXPECT_EQ(file.size_bytes(), 6u);
  EXPECT_THAT(file.read(2, 3),
              ::testing::ElementsAre(std::byte{'c'}, std::byte{'d'}, std::byte{'e'}));
  EXPECT_EQ(file.read(0, 6).size(), 6u);
  EXPECT_TRUE(file.read(6, 0).empty());
}

TEST(FileBytes, RefusesPartsBeyondTheEnd) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abcdef");
  const FileBytes file(folder / "f");
  EXPECT_THROW(file.read(0, 7), std::runtime_error);
  EXPECT_THROW(file.read(7, 0), std::runtime_error);
  EXPECT_THROW(file.read(1, ~std::uint64_t{0}), std::runtime_error);
  EXPECT_EQ(file.read(5, 1).size(), 1u);  // a refusal leaves the file readable
}

TEST(FileBytes, SaysThatAFileBecameShorter) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abcdef");
  const FileBytes file(folder / "f");
  std::filesystem::resize_file(folder / "f", 2);
  EXPECT_THROW(file.read(0, 6), std::runtime_error);
}

TEST(FileBytes, RefusesFoldersAndAbsentFiles) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(FileBytes(folder.path()), std::runtime_error);
  EXPECT_THROW(FileBytes(folder / "none"), std::runtime_error);
}

}  // namespace
}  // namespace eventgan
