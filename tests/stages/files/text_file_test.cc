#include "stages/files/text_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(ReadTextFile, GivesEveryByte) {
  const testing::TemporaryFolder folder;
  for (const std::string& text :
       {std::string(), std::string("one\r\n\0\xff", 7), std::string(100'000, 'x')}) {
    testing::write_file(folder / "file", text);
    EXPECT_EQ(read_text_file(folder / "file"), text);
  }
}

TEST(ReadTextFile, NamesWhatItCannotRead) {
  const testing::TemporaryFolder folder;
  const auto fault_of = [](const std::filesystem::path& path) -> std::string {
    try {
      read_text_file(path);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_EQ(fault_of(folder / "none"),
            "cannot read " + (folder / "none").string() + ": No such file or directory");
  EXPECT_EQ(fault_of(folder.path()), "cannot read " + folder.path().string() + ": Is a directory");
}

}  // namespace
}  // namespace eventgan
