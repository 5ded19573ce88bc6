#include "stages/base/archives/zip_archive.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <random>
#include <stdexcept>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using ::testing::ElementsAre;

std::string text(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Little-endian bytes of a number, as zip headers hold sizes.
std::string number(std::uint64_t value, int width) {
  std::string bytes;
  for (int i = 0; i < width; ++i) bytes += static_cast<char>(value >> (8 * i));
  return bytes;
}

std::string u32(std::uint32_t value) { return number(value, 4); }

// The last record of a zip file, whose directory begins at that byte and is that large.
std::string last_record(std::uint32_t directory, std::uint32_t size) {
  return "PK\5\6"s + u32(0) + number(1, 2) + number(1, 2) + u32(size) + u32(directory) +
         number(0, 2);
}

// Zip64's record, for numbers that the last one has no room for, and what leads to it from `at`.
std::string record64(std::uint64_t at, std::uint64_t directory, std::uint64_t size) {
  const std::string record = "PK\6\6"s + number(44, 8) + u32(0) + u32(0) + u32(0) + number(1, 8) +
                             number(1, 8) + number(size, 8) + number(directory, 8);
  return record + "PK\6\7"s + u32(0) + number(at, 8) + u32(1);
}

// A zip file as Python writes it of a stored member "big" beyond 4 GiB: zeros, then `end`. The file
// is sparse.
void write_big_zip(const std::filesystem::path& file, std::uint64_t size, const std::string& end) {
  const std::string sizes = number(1, 2) + number(16, 2) + number(size, 8) + number(size, 8);
  const std::string version = number(45, 2);
  const std::string about = version + u32(0) + u32(0) + u32(0) +     // method, time, checksum
                            u32(0xffffffff) + u32(0xffffffff) +      // in `sizes`
                            number(3, 2) + number(sizes.size(), 2);  // of "big"
  const std::string local = "PK\3\4"s + about + "big" + sizes;
  testing::write_file(file, local);
  std::filesystem::resize_file(file, local.size() + size - end.size());
  const std::string entry =
      "PK\1\2"s + version + about + number(0, 6) + u32(0) + u32(0) + "big" + sizes;
  const std::uint64_t directory = local.size() + size;
  std::ofstream(file, std::ios::app | std::ios::binary)
      << end << entry << record64(directory + entry.size(), directory, entry.size())
      << last_record(0xffffffff, static_cast<std::uint32_t>(entry.size()));
}

class ZipArchiveTest : public ::testing::Test {
 protected:
  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "some.zip";
};

TEST_F(ZipArchiveTest, ReadsStoredAndDeflatedMembersInTheirOrder) {
  const std::string zeros(100000, '\0');
  testing::write_zip(file_, {{"b.npy", "stored"}, {"a/empty", ""}, {"z", zeros, true}});
  const ZipArchive archive(file_);
  EXPECT_THAT(archive.names(), ElementsAre("b.npy", "a/empty", "z"));
  EXPECT_TRUE(archive.contains("a/empty"));
  EXPECT_FALSE(archive.contains("a"));
  EXPECT_EQ(text(archive.read("b.npy")), "stored");
  EXPECT_TRUE(archive.read("a/empty").empty());
  EXPECT_EQ(text(archive.read("z")), zeros);
  EXPECT_EQ(text(archive.read("b.npy")), "stored") << "a member can be read twice";
}

TEST_F(ZipArchiveTest, ReadsPartsOfStoredAndDeflatedMembers) {
  std::mt19937 random(3);
  std::string content;
  for (int i = 0; i < 200000; ++i) content += static_cast<char>('a' + random() % 16);
  testing::write_zip(file_, {{"stored", content}, {"deflated", content, true}, {"empty", ""}});
  const ZipArchive archive(file_);
  for (const char* name : {"stored", "deflated"}) {
    EXPECT_EQ(archive.size_bytes(name), content.size());
    using Part = std::pair<std::size_t, std::size_t>;
    for (const auto& [offset, count] :
         {Part{0, 0}, Part{0, 10}, Part{1, 1}, Part{65535, 3}, Part{65536, 100000},
          Part{199990, 10}, Part{200000, 0}, Part{0, 200000}}) {
      EXPECT_EQ(text(archive.read_part(name, offset, count)), content.substr(offset, count))
          << name << " " << offset << " " << count;
    }
    EXPECT_THROWS(archive.read_part(name, 199990, 11), std::runtime_error,
                  "expected 11 bytes from byte 199990 on, got \"a member of 200000\", in ",
                  std::string("some.zip (member ") + name + ")");
    EXPECT_THROWS(archive.read_part(name, 200001, 0), std::runtime_error, "from byte 200001 on");
    EXPECT_THROWS(archive.read_part(name, 1, std::numeric_limits<std::uint64_t>::max()),
                  std::runtime_error, "from byte 1 on");
  }
  EXPECT_TRUE(archive.read_part("empty", 0, 0).empty());
  EXPECT_THROWS(archive.read_part("empty", 0, 1), std::runtime_error, "got \"a member of 0\"");
}

TEST_F(ZipArchiveTest, ReadsPartsBeyondFourGigabytesAndOpensWithoutReadingTheRest) {
  constexpr std::uint64_t kSize = 5'000'000'000;
  write_big_zip(file_, kSize, "the end");
  const InputCounter counter;
  const ZipArchive archive(file_);
  EXPECT_LT(counter.of(file_).bytes, 200'000u);
  EXPECT_EQ(archive.size_bytes("big"), kSize);
  EXPECT_EQ(text(archive.read_part("big", kSize - 8, 8)), "\0the end"s);
  EXPECT_THROWS(archive.read_part("big", kSize - 7, 8), std::runtime_error, "(member big)");
}

TEST_F(ZipArchiveTest, NamesTheMissingMember) {
  testing::write_zip(file_, {{"a", "x"}});
  const ZipArchive archive(file_);
  EXPECT_THROWS(archive.size_bytes("b"), std::runtime_error, "some.zip", "(member b)");
  EXPECT_THROWS(archive.read_part("b", 0, 1), std::runtime_error, "some.zip", "(member b)");
  EXPECT_THROWS(archive.read("data.pkl"), std::runtime_error, "some.zip", "(member data.pkl)");
}

/// Lets the process open `count` more files while it lives.
class FilesLeft {
 public:
  explicit FilesLeft(int count) {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const int next = ::open("/dev/null", O_RDONLY);  // all below are open
    ::close(next);
    const rlimit limit{static_cast<rlim_t>(next + count), before_.rlim_max};
    ::setrlimit(RLIMIT_NOFILE, &limit);
  }
  ~FilesLeft() { ::setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_{};
};

TEST_F(ZipArchiveTest, TooManyOpenFilesAreNoFaultOfTheFile) {
  testing::write_zip(file_, {{"a", "x"}});
  constexpr int kNeeded = 3;  // InputFile's, libzip's, and one that libzip makes of it
  for (int count = 0; count <= kNeeded; ++count) {
    std::exception_ptr thrown;  // looked at when there are files left: UBSan needs some
    try {
      const FilesLeft left(count);
      ZipArchive archive(file_);
    } catch (...) {
      thrown = std::current_exception();
    }
    ASSERT_EQ(thrown == nullptr, count == kNeeded) << count;
    if (!thrown) continue;
    EXPECT_THAT(
        [&] { std::rethrow_exception(thrown); },
        ::testing::ThrowsMessage<LimitReached>(::testing::AllOf(
            ::testing::HasSubstr("some.zip: Too many open files"), ::testing::HasSubstr("ulimit"))))
        << count;
  }
}

TEST_F(ZipArchiveTest, ReadsNoMoreBytesThanAllowed) {
  testing::write_zip(file_, {{"a", "12345"}, {"b", std::string(1000, 'x'), true}});
  const ZipArchive archive(file_);
  EXPECT_EQ(text(archive.read("a", 5)), "12345");
  EXPECT_THROWS(archive.read("a", 4), std::runtime_error, "at most 4 bytes");
  EXPECT_THROWS(archive.read("b", 999), std::runtime_error, "expected at most 999 bytes");
}

TEST_F(ZipArchiveTest, RefusesWhatIsNoZipFileOrATruncatedOne) {
  EXPECT_THROWS(ZipArchive(folder_ / "absent.zip"), std::runtime_error, "absent.zip");
  for (const std::string& content : {std::string(), std::string("no zip file at all")}) {
    testing::write_file(file_, content);
    EXPECT_THROWS(ZipArchive{file_}, std::runtime_error, "expected a zip file");
  }
  testing::write_zip(file_, {{"a", std::string(1000, 'x')}});
  const std::string whole = testing::read_file(file_);
  testing::write_file(file_, whole.substr(0, whole.size() / 2));
  EXPECT_THROWS(ZipArchive{file_}, std::runtime_error,
                "expected a zip file, got \"Not a zip archive\"");
}

TEST_F(ZipArchiveTest, FindsDamageByTheChecksum) {
  for (const bool deflated : {false, true}) {
    testing::write_zip(file_, {{"a", "0123456789abcdefghijklmnopqrstuvwxyz", deflated}});
    std::string whole = testing::read_file(file_);
    // The content follows the local header of 30 bytes and the name; its 11th byte gets another
    // bit.
    whole[30 + 1 + 10] ^= 0x10;
    testing::write_file(file_, whole);
    const ZipArchive archive(file_);
    EXPECT_THROWS(archive.read("a"), std::runtime_error, "(member a)");
  }
}

TEST_F(ZipArchiveTest, RefusesADirectoryThatWouldFillTheMemory) {
  std::string signatures;
  for (int i = 0; i < 65537; ++i) signatures += "PK\1\2 and more than a block of 1 MiB of them";
  const auto end = static_cast<std::uint32_t>(signatures.size());
  const std::string beyond = last_record(0xffffffff, 1);  // as zip64's record says
  for (const std::string& records :
       {last_record(0, end), last_record(0, 1),
        // Of two records, and of zip64's and the last one, the first place counts.
        last_record(0, end) + last_record(end, 1), last_record(end, 1) + last_record(0, end),
        record64(end, end, 1) + last_record(0, 1), record64(end, 0, 1) + beyond,
        // With the longest comment; without zip64's record, or with a part of it.
        record64(end, 0, 1) + beyond + std::string(65535, ' '),
        record64(1u << 31, 0, 1) + last_record(0, 1),
        record64(end + 60, 0, 1) + last_record(0, 1)}) {
    testing::write_file(file_, signatures + records);
    EXPECT_THROWS(ZipArchive archive(file_), std::runtime_error, "at most 65536 members");
  }
  testing::write_zip(file_, {{"holds them", signatures}});
  EXPECT_EQ(ZipArchive(file_).names().size(), 1u) << "a member may hold what it likes";
}

TEST_F(ZipArchiveTest, DoesNotTrustTheDeclaredSize) {
  for (const bool deflated : {false, true}) {
    const std::string content(1000, 'x');
    testing::write_zip(file_, {{"a", content, deflated}});
    std::string whole = testing::read_file(file_);
    // 1000 is the uncompressed size, in the local and in the central header; make it 2 GiB in both.
    int changed = 0;
    for (std::size_t at = 0; (at = whole.find(u32(1000), at)) != std::string::npos; at += 4) {
      whole.replace(at, 4, u32(0x80000000u));
      ++changed;
    }
    ASSERT_GE(changed, 2);
    testing::write_file(file_, whole);
    EXPECT_THROWS(ZipArchive(file_).read("a"), std::runtime_error, "some.zip");
    EXPECT_THROWS(ZipArchive(file_).size_bytes("a"), std::runtime_error, "some.zip");
    EXPECT_THROWS(ZipArchive(file_).read_part("a", 0, 0x80000000u), std::runtime_error, "some.zip");
  }
}

TEST_F(ZipArchiveTest, FindsADeflatedMemberThatEndsBeforeItsDeclaredSize) {
  testing::write_zip(file_, {{"a", std::string(1000, 'x'), true}});
  std::string whole = testing::read_file(file_);
  for (std::size_t at = 0; (at = whole.find(u32(1000), at)) != std::string::npos;) {
    whole.replace(at, 4, u32(1200));  // deflate could have made that many of its bytes
  }
  testing::write_file(file_, whole);
  const ZipArchive archive(file_);
  EXPECT_EQ(archive.size_bytes("a"), 1200u);
  EXPECT_EQ(text(archive.read_part("a", 990, 10)), "xxxxxxxxxx");
  EXPECT_THROWS(archive.read_part("a", 990, 11), std::runtime_error, "(member a)");
  EXPECT_THROWS(archive.read_part("a", 1100, 1), std::runtime_error, "(member a)");
}

TEST_F(ZipArchiveTest, RefusesAMemberTwice) {
  testing::write_zip(file_, {{"a", "1", false}, {"b", "2", false}, {"x", "3", false}});
  std::string whole = testing::read_file(file_);
  std::ranges::replace(whole, 'x', 'a');  // libzip writes no name twice
  testing::write_file(file_, whole);
  EXPECT_THROWS(ZipArchive{file_}, std::runtime_error,
                ::testing::Eq("expected each member once, got one twice, in " + file_.string() +
                              " (member a)"));
}

TEST_F(ZipArchiveTest, ReadsPyTorchCheckpoint) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const ZipArchive archive(data / "golden" / "checkpoint_zip.pt");
  EXPECT_EQ(archive.names().size(), 106u);  // data.pkl, version, 104 storages
  EXPECT_EQ(archive.read("checkpoint_zip/data.pkl").size(), 14495u);
  EXPECT_EQ(archive.read("checkpoint_zip/data/100").size(), 1048576u);
}

}  // namespace
}  // namespace eventgan
