#include "stages/base/files/input_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "stages/base/files/sha256.h"
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

/// Whether all of the file lies in the system's cache.
bool is_cached(const std::filesystem::path& file) {
  std::string reason;
  const InputFile opened = open_input(file, reason);
  const std::size_t size = std::filesystem::file_size(file);
  void* const mapped = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, ::fileno(opened.get()), 0);
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  std::vector<unsigned char> pages((size + page - 1) / page);
  const bool known = mapped != MAP_FAILED && ::mincore(mapped, size, pages.data()) == 0;
  ::munmap(mapped, size);
  return known && std::ranges::all_of(pages, [](unsigned char state) { return state & 1; });
}

TEST(LoadAhead, BringsAllOfAFileIntoTheCache) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path file = folder / "file";
  testing::write_file(file, std::string(3'000'001, 'x'));
  {
    std::string reason;
    const InputFile opened = open_input(file, reason);
    ::fdatasync(::fileno(opened.get()));
    ::posix_fadvise(::fileno(opened.get()), 0, 0, POSIX_FADV_DONTNEED);
  }
  if (is_cached(file)) GTEST_SKIP() << "this file system keeps its files in memory";
  load_ahead(file);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!is_cached(file) && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_TRUE(is_cached(file));
}

TEST(LoadAhead, OfWhatIsNoFileDoesNothing) {
  const testing::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  testing::write_file(folder / "empty", "");
  for (const char* name : {"fifo", "empty", "none", "."}) load_ahead(folder / name);
}

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
