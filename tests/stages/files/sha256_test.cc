#include "stages/files/sha256.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

// FIPS 180-4 and the examples NIST publishes with it.
constexpr char kOfNothing[] = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr char kOfAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr char kOfMillionA[] = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

TEST(Sha256, GivesPublishedDigests) {
  EXPECT_EQ(sha256_hex(std::string_view()), kOfNothing);
  EXPECT_EQ(sha256_hex("abc"), kOfAbc);
}

TEST(Sha256, OfPiecesIsThatOfTheWhole) {
  Sha256 hash;
  EXPECT_EQ(hash.hex(), kOfNothing);
  hash.update("a");
  EXPECT_EQ(hash.hex(), sha256_hex("a"));
  hash.update("");
  hash.update("bc");
  EXPECT_EQ(hash.hex(), kOfAbc);
  EXPECT_EQ(hash.hex(), kOfAbc);
}

TEST(Sha256, OfAFileIsThatOfItsBytes) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "empty", "");
  EXPECT_EQ(sha256_of_file(folder / "empty"), kOfNothing);
  testing::write_file(folder / "one", std::string(1000000, 'a'));
  EXPECT_EQ(sha256_of_file(folder / "one"), kOfMillionA);
  // More than one block, and not a whole number of them.
  const std::string large(2500001, 'x');
  testing::write_file(folder / "large", large);
  EXPECT_EQ(sha256_of_file(folder / "large"), sha256_hex(large));
}

TEST(Sha256, NamesAFileThatCannotBeRead) {
  const testing::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  for (const auto& path : {folder / "absent", folder.path(), folder / "fifo"}) {
    try {
      sha256_of_file(path);
      FAIL() << "no error for " << path;
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace eventgan
