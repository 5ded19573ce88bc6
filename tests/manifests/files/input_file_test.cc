#include "manifests/files/input_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

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
TEST(InputFile, TakesRegularFilesOnlyAndNeverWaits) {
  const testing::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  std::filesystem::create_symlink("/dev/zero", folder / "device");
  std::string reason;
  for (const char* name : {"fifo", "device"}) {
    EXPECT_FALSE(InputFile::open(folder / name, reason)) << name;
    EXPECT_EQ(reason, "Not a regular file") << name;
    EXPECT_THROWS(read_text_file(folder / name), std::runtime_error, "Not a regular file") << name;
    EXPECT_THROWS(require_regular_file(folder / name), InputError,
                  ::testing::Eq("expected a readable file, got 'Not a regular file', in " +
                                (folder / name).string()));
  }
  testing::write_file(folder / "file", "text");
  std::filesystem::create_symlink("file", folder / "link");
  EXPECT_EQ(read_text_file(folder / "link"), "text");
  require_regular_file(folder / "link");
}

/// Whether all of the file lies in the system's cache.
bool is_cached(const std::filesystem::path& file) {
  const InputFile opened(file);
  const std::size_t size = std::filesystem::file_size(file);
  void* const mapped = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, opened.descriptor(), 0);
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  std::vector<unsigned char> pages((size + page - 1) / page);
  const bool known = mapped != MAP_FAILED && ::mincore(mapped, size, pages.data()) == 0;
  ::munmap(mapped, size);
  return known && std::ranges::all_of(pages, [](unsigned char state) { return state & 1; });
}

TEST(InputFile, IsLoadedAheadIntoTheCache) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path file = folder / "file";
  testing::write_file(file, std::string(3'000'001, 'x'));
  {
    const InputFile opened(file);
    ::fdatasync(opened.descriptor());
    ::posix_fadvise(opened.descriptor(), 0, 0, POSIX_FADV_DONTNEED);
  }
  if (is_cached(file)) GTEST_SKIP() << "this file system keeps its files in memory";
  InputFile(file).load_ahead();
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!is_cached(file) && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_TRUE(is_cached(file));
}

TEST(InputFile, ReadsParts) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abcdef");
  const InputFile file(folder / "f");
  EXPECT_EQ(file.size_bytes(), 6u);
  EXPECT_EQ(file.read(2, 3), "cde");
  EXPECT_THAT(file.read_bytes(2, 2), ElementsAre(std::byte{'c'}, std::byte{'d'}));
  EXPECT_EQ(file.read(0, 6), "abcdef");
  EXPECT_EQ(file.read(6, 0), "");
  std::array<char, 4> part{};
  EXPECT_EQ(file.read_some(3, part), 3u);
  EXPECT_EQ(std::string_view(part.data(), 3), "def");
  EXPECT_EQ(file.read_some(7, part), 0u);
}

TEST(InputFile, RefusesPartsBeyondTheEnd) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abcdef");
  const InputFile file(folder / "f", "f");
  EXPECT_THROWS(file.read(0, 7), InputError,
                ::testing::Eq("expected 7 bytes from byte 0 on, got a file of 6 bytes, in f"));
  EXPECT_THROWS(file.read(7, 0), InputError,
                "expected 0 bytes from byte 7 on, got a file of 6 bytes, in f");
  EXPECT_THROWS(file.read_bytes(1, ~std::uint64_t{0}), InputError,
                "bytes from byte 1 on, got a file of 6 bytes");
  EXPECT_EQ(file.read(5, 1), "f");
  EXPECT_EQ(file.end_byte(), 6);
  EXPECT_EQ(file.read_between(2, 4), "cd");
  EXPECT_EQ(file.read_between(6, 6), "");
  EXPECT_THROWS(file.read_between(2, 7), InputError,
                "expected 5 bytes from byte 2 on, got a file of 6 bytes, in f");
  EXPECT_THROWS(file.read_between(2, 1), InputError, "bytes from byte 2 on, got a file of 6 bytes");
}

TEST(InputFile, SaysThatAFileBecameShorter) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abcdef");
  const InputFile file(folder / "f", "f");
  std::filesystem::resize_file(folder / "f", 2);
  EXPECT_THROWS(file.read(1, 5), InputError,
                ::testing::Eq("expected 5 bytes from byte 1 on, got a file that has "
                              "shrunk to 2 bytes, in f"));
  EXPECT_EQ(file.read_all(), "ab");
}

TEST(InputFile, ReadsAllOfAFileThatHasGrownOrTellsNoSize) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abc");
  const InputFile file(folder / "f");
  const std::string longer(10'000, 'x');
  testing::write_file(folder / "f", longer);
  EXPECT_EQ(file.read_all(), longer);
  const InputFile told("/proc/self/status");
  EXPECT_EQ(told.size_bytes(), 0u);
  EXPECT_THAT(told.read_all(), ::testing::StartsWith("Name:"));
}

TEST(InputFile, RefusesFoldersAndAbsentFiles) {
  const testing::TemporaryFolder folder;
  EXPECT_THROWS(InputFile(folder.path(), "it"), InputError,
                ::testing::Eq("expected a readable file, got 'Is a directory', in it"));
  EXPECT_THROWS(InputFile(folder / "none"), InputError,
                "expected a readable file, got 'No such file or directory'");
}

/// What a library does to a stream of C.
class StreamOfC : public ::testing::TestWithParam<std::size_t> {};

TEST_P(StreamOfC, MovesAndEnds) {
  const testing::TemporaryFolder folder;
  std::string text;
  for (int i = 0; i < 20'000; ++i) text += static_cast<char>(i * 7 + i / 256);
  testing::write_file(folder / "f", text);
  const InputFile file(folder / "f");
  const InputFile::Stream stream = file.stream(GetParam());
  std::FILE* const c = stream.get();
  std::string got(text.size() + 1, '\0');
  EXPECT_EQ(std::fread(got.data(), 1, got.size(), c), text.size());
  EXPECT_NE(std::feof(c), 0);
  EXPECT_EQ(std::ftell(c), 20'000);
  got.pop_back();
  EXPECT_EQ(got, text);
  std::rewind(c);
  EXPECT_EQ(std::fgetc(c), static_cast<unsigned char>(text[0]));
  ASSERT_EQ(std::fseek(c, 12'000, SEEK_CUR), 0);
  EXPECT_EQ(std::fgetc(c), static_cast<unsigned char>(text[12'001]));
  ASSERT_EQ(std::fseek(c, -3, SEEK_END), 0);
  EXPECT_EQ(std::ftell(c), 19'997);
  EXPECT_EQ(std::fgetc(c), static_cast<unsigned char>(text[19'997]));
  EXPECT_NE(std::fseek(c, -1, SEEK_SET), 0);
}

INSTANTIATE_TEST_SUITE_P(InputFile, StreamOfC,
                         ::testing::Values(std::size_t{1}, 1'000, 20'000, 1'000'000));

TEST(InputFile, AStreamOfCReadsABlockOnce) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", std::string(20'000, 'x'));
  const InputFile file(folder / "f");
  const InputCounter counter;
  const InputFile::Stream stream = file.stream(8'192);
  std::array<char, 6'000> part;
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(std::fread(part.data(), 1, part.size(), stream.get()), part.size());
    std::rewind(stream.get());
  }
  EXPECT_EQ(counter.of(folder / "f").bytes, 8'192u);
}

TEST(InputCounter, CountsOpensAndBytesOfEachFile) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "f", "abcdef");
  testing::write_file(folder / "g", std::string(3'000'000, 'x'));
  const InputFile before(folder / "f");
  const InputCounter counter;
  const auto of = [&](const char* name) {
    const InputCounter::Count count = counter.of(folder / name);
    return std::pair(count.opens, count.bytes);
  };
  EXPECT_EQ(of("f"), std::pair(0ul, 0ul));
  before.read(1, 2);
  EXPECT_EQ(of("f"), std::pair(0ul, 2ul));
  read_text_file(folder / "." / "f");
  EXPECT_EQ(of("f"), std::pair(1ul, 8ul));
  sha256_of_file(folder / "g");
  require_regular_file(folder / "g");
  EXPECT_EQ(of("g"), std::pair(2ul, 3'000'000ul));
  EXPECT_THROWS(InputFile(folder / "none"), InputError,
                "expected a readable file, got 'No such file or directory'");
  EXPECT_EQ(of("none"), std::pair(0ul, 0ul));
}

// FIPS 180-4 and the examples NIST publishes with it.
constexpr char kOfNothing[] = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr char kOfAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr char kOfMillionA[] = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

TEST(Sha256, GivesPublishedDigestsOfPiecesToo) {
  EXPECT_EQ(sha256_hex(std::string_view()), kOfNothing);
  EXPECT_EQ(sha256_hex("abc"), kOfAbc);
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
