#include "stages/files/text_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

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
  std::filesystem::create_symlink("loop", folder / "loop");
  EXPECT_EQ(fault_of(folder / "loop"),
            "cannot read " + (folder / "loop").string() + ": Too many levels of symbolic links");
  EXPECT_EQ(fault_of(folder.path()), "cannot read " + folder.path().string() + ": Is a directory");
}

/// Opening a FIFO waits for its writer, and a device need not end.
TEST(OpenInput, TakesRegularFilesOnlyAndNeverWaits) {
  const testing::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  std::filesystem::create_symlink("/dev/zero", folder / "device");
  std::string reason;
  for (const char* name : {"fifo", "device"}) {
    EXPECT_EQ(open_input(folder / name, reason), nullptr) << name;
    EXPECT_EQ(reason, "Not a regular file") << name;
    EXPECT_THROW(read_text_file(folder / name), std::runtime_error) << name;
    EXPECT_THROW(require_regular_file(folder / name), std::runtime_error) << name;
  }
  testing::write_file(folder / "file", "text");
  std::filesystem::create_symlink("file", folder / "link");
  EXPECT_EQ(read_text_file(folder / "link"), "text");
  require_regular_file(folder / "link");
}

}  // namespace
}  // namespace eventgan
