#include "stages/exports/array_files.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <numeric>

#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TypedArray parse(const std::string& npy) { return parse_npy(std::as_bytes(std::span(npy)), "x"); }

TEST(NpyFile, IsReadBack) {
  const std::vector<double> values{1, 2.5, -3, 4, 5, 6};
  const TypedArray array = parse(npy_file("<f8", {2, 3}, values));
  EXPECT_EQ(array.shape, (std::vector<std::size_t>{2, 3}));
  EXPECT_EQ(std::get<std::vector<double>>(array.values), values);
}

TEST(NpyFile, IsAsNumpyWritesIt) {
  const std::string file = npy_file("|u1", {3}, std::vector<std::uint8_t>{7, 8, 9});
  EXPECT_EQ(file.substr(0, 10), std::string("\x93NUMPY\x01\x00\x76\x00", 10));
  EXPECT_EQ(file.substr(10, 59), "{'descr': '|u1', 'fortran_order': False, 'shape': (3,), }  ");
  EXPECT_EQ(file.size(), 128u + 3);  // the values begin at a multiple of 64
  EXPECT_EQ(file.substr(127), "\n\x07\x08\x09");
}

TEST(NpyFile, ASingleValueHasNoSides) {
  const TypedArray array = parse(npy_file("<f4", {}, std::vector<float>{0.5f}));
  EXPECT_TRUE(array.shape.empty());
  EXPECT_EQ(array.number(0), 0.5);
}

TEST(NpyFile, RefusesAnotherNumberOfValues) {
  EXPECT_THROW(npy_file("<f4", {2}, std::vector<float>{1}), std::invalid_argument);
}

TEST(NpyTexts, AreReadBack) {
  const std::vector<std::string> texts{"S1/a", "", "\xc3\xa9t\xc3\xa9"};
  const TypedArray array = parse(npy_texts(texts));
  EXPECT_EQ(std::get<std::vector<std::string>>(array.values), texts);
}

TEST(NpyTexts, WhatIsNotUtf8IsReplaced) {
  EXPECT_EQ(parse(npy_texts({"a\xff"})).text(0), "a\xef\xbf\xbd");
}

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

TEST(TarMember, IsAnUstarHeaderAndPaddedBytes) {
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
}

TEST(TarMember, RefusesALongName) {
  EXPECT_NO_THROW(tar_member(std::string(100, 'a'), ""));
  EXPECT_THROW(tar_member(std::string(101, 'a'), ""), std::invalid_argument);
  EXPECT_THROW(tar_member("", ""), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
