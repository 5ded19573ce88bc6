#include "stages/frames/mpii/same_bytes.h"

#include <gtest/gtest.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(SameBytes, ComparesSizeAndContent) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "a", std::string_view("x\0y", 3));
  testing::write_file(folder / "same", std::string_view("x\0y", 3));
  testing::write_file(folder / "other", std::string_view("x\0z", 3));
  testing::write_file(folder / "longer", std::string_view("x\0yy", 4));
  testing::write_file(folder / "empty", "");
  EXPECT_TRUE(same_bytes(folder / "a", folder / "same"));
  EXPECT_TRUE(same_bytes(folder / "empty", folder / "empty"));
  EXPECT_FALSE(same_bytes(folder / "a", folder / "other"));
  EXPECT_FALSE(same_bytes(folder / "a", folder / "longer"));
  EXPECT_FALSE(same_bytes(folder / "a", folder / "absent"));
  EXPECT_FALSE(same_bytes(folder / "absent", folder / "absent"));
}

}  // namespace
}  // namespace eventgan
