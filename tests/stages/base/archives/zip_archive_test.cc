#include "stages/base/archives/zip_archive.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

#include "manifests/values/faults.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

std::string text(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Little-endian bytes of a 32-bit number, as zip headers hold sizes.
std::string u32(std::uint32_t value) {
  std::string bytes;
  for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i));
  return bytes;
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

TEST_F(ZipArchiveTest, NamesTheMissingMember) {
  testing::write_zip(file_, {{"a", "x"}});
  const ZipArchive archive(file_);
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
  testing::write_file(file_, signatures);
  EXPECT_THROWS(ZipArchive archive(file_), std::runtime_error, "at most 65536 members");
  testing::write_zip(file_, {{"holds them", signatures.substr(0, 1000)}});
  EXPECT_EQ(ZipArchive(file_).names().size(), 1u);
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
  }
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
