#include "stages/exports/array_files.h"

#include <gtest/gtest.h>

#include <numeric>

#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(NpzFile, IsAZipOfArraysAndTheSameEachTime) {
  std::vector<float> zeros(10000, 0.0f);
  const std::string file = npz_file({{"volume", npy_file("<f4", {10000}, zeros)},
                                     {"scale", npy_file("<f4", {}, std::vector<float>{2})}});
  EXPECT_LT(file.size(), 1000u);  // deflated
  EXPECT_EQ(file, npz_file({{"volume", npy_file("<f4", {10000}, zeros)},
                            {"scale", npy_file("<f4", {}, std::vector<float>{2})}}));
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "a.npz", file);
  const ZipArchive archive(folder / "a.npz");
  EXPECT_EQ(archive.names(), (std::vector<std::string>{"volume.npy", "scale.npy"}));
  EXPECT_EQ(parse_npy(archive.read("scale.npy"), "scale").number(0), 2);
}

TEST(TarMember, IsAnUstarHeaderOfAShortNameAndPaddedBytes) {
  const std::string member = tar_member("a.json", "{}\n");
  ASSERT_EQ(member.size(), 1024u);
  EXPECT_EQ(member.substr(0, 7), std::string("a.json\0", 7));
  EXPECT_EQ(member.substr(124, 12), std::string("00000000003\0", 12));
  EXPECT_EQ(member.substr(136, 12), std::string("00000000000\0", 12));
  EXPECT_EQ(member.substr(257, 8), std::string("ustar\00000", 8));
  // The sum of the header's bytes, its own field taken as blanks.
  std::string header = member.substr(0, 512);
  header.replace(148, 8, 8, ' ');
  const int sum = std::accumulate(header.begin(), header.end(), 0, [](int before, char c) {
    return before + static_cast<unsigned char>(c);
  });
  EXPECT_EQ(std::stoi(member.substr(148, 6), nullptr, 8), sum);
  EXPECT_EQ(member.substr(512, 4), std::string("{}\n\0", 4));
  EXPECT_EQ(tar_member("a", std::string(512, 'x')).size(), 1024u);
  EXPECT_EQ(tar_end(), std::string(1024, '\0'));
  EXPECT_NO_THROW(tar_member(std::string(100, 'a'), ""));
  EXPECT_THROWS(tar_member(std::string(101, 'a'), ""), std::invalid_argument,
                "expected a tar member with a name of 1..100 bytes and less", "in aaa");
  EXPECT_THROWS(tar_member("", ""), std::invalid_argument,
                "expected a tar member with a name of 1..100 bytes and less");
}

}  // namespace
}  // namespace eventgan
