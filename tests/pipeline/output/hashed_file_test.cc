#include "pipeline/output/hashed_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <istream>
#include <iterator>
#include <system_error>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(HashedFile, GivesTheBytesAndTheirHash) {
  const testing::TemporaryFolder folder;
  // Nothing; less than a block; a block; several and a part of one.
  for (const std::size_t size : {0, 5, 1 << 20, (3 << 20) + 1}) {
    const std::string text(size, 'x');
    testing::write_file(folder / "a", text);
    HashedFile file(folder / "a");
    ASSERT_TRUE(file.is_open());
    std::istream stream(&file);
    EXPECT_EQ((std::string{std::istreambuf_iterator<char>(stream), {}}), text);
    EXPECT_EQ(file.hash_of_read(), sha256_hex(text));
  }
}

TEST(HashedFile, AnErrorOfReadingIsNotTheEnd) {
  const testing::TemporaryFolder folder;
  HashedFile file(folder.path());
  std::istream stream(&file);
  stream.exceptions(std::ios::badbit);
  std::string line;
  EXPECT_THAT([&] { std::getline(stream, line); },
              ::testing::ThrowsMessage<std::system_error>(
                  ::testing::HasSubstr("cannot read " + folder.path().string())));
  EXPECT_FALSE(HashedFile(folder / "absent").is_open());
}

}  // namespace
}  // namespace eventgan
