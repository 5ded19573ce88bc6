#include "stages/shards/codec/fletcher32.h"

#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

TEST(Fletcher32, FollowsItsDefinition) {
  EXPECT_EQ(fletcher32({}), 0u);
  // Words 0x6162, 0x6364: first = 0xc4c6; second = 0x6162 + 0xc4c6 = 0x12628, folded 0x2629.
  EXPECT_EQ(fletcher32(bytes_of("abcd")), 0x2629c4c6u);
  // An odd last byte is a high half: words 0x6162, 0x6300.
  EXPECT_EQ(fletcher32(bytes_of("abc")), fletcher32(bytes_of(std::string_view("abc\0", 4))));
}

/// What HDF5 itself appends to a chunk of these bytes.
std::uint32_t checksum_by_hdf5(const std::vector<std::byte>& bytes) {
  const testing::TemporaryFolder folder;
  const hsize_t size = bytes.size();
  const hid_t file = H5Fcreate((folder / "x.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(creation, 1, &size);
  H5Pset_fletcher32(creation);
  const hid_t space = H5Screate_simple(1, &size, nullptr);
  const hid_t dataset =
      H5Dcreate2(file, "d", H5T_STD_U8LE, space, H5P_DEFAULT, creation, H5P_DEFAULT);
  H5Dwrite(dataset, H5T_STD_U8LE, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
  H5Fflush(file, H5F_SCOPE_LOCAL);
  std::vector<unsigned char> chunk(bytes.size() + 4);
  const hsize_t offset = 0;
  std::uint32_t filters_skipped = 0;
  EXPECT_GE(H5Dread_chunk(dataset, H5P_DEFAULT, &offset, &filters_skipped, chunk.data()), 0);
  H5Dclose(dataset);
  H5Sclose(space);
  H5Pclose(creation);
  H5Fclose(file);
  const unsigned char* end = chunk.data() + bytes.size();
  return end[0] | end[1] << 8 | end[2] << 16 | static_cast<std::uint32_t>(end[3]) << 24;
}

TEST(Fletcher32, IsWhatHdf5Writes) {
  std::mt19937 random(1);
  // Around a row of 32 bytes, the 720 bytes after which HDF5 folds and the 11520 after which we
  // reduce, odd and even; all ones make the sums as large as they get, and multiples of 65535,
  // which must not become 0; zeros, of which the sums are.
  for (const std::size_t size :
       {1, 2, 3, 31, 32, 33, 719, 720, 721, 722, 11519, 11520, 11521, 11552, 100003}) {
    std::vector<std::byte> bytes(size);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
    EXPECT_EQ(fletcher32(bytes), checksum_by_hdf5(bytes)) << size;
    std::fill(bytes.begin(), bytes.end(), std::byte{0xff});
    EXPECT_EQ(fletcher32(bytes), checksum_by_hdf5(bytes)) << size << " of 0xff";
    std::fill(bytes.begin(), bytes.end(), std::byte{0});
    EXPECT_EQ(fletcher32(bytes), checksum_by_hdf5(bytes)) << size << " of 0";
    bytes.back() = std::byte{0xff};
    EXPECT_EQ(fletcher32(bytes), checksum_by_hdf5(bytes)) << size << " of 0 but the last";
  }
}

/// As HDF5 computes it, word by word.
std::uint32_t plain_fletcher32(std::span<const std::byte> bytes) {
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    first += std::to_integer<std::uint32_t>(bytes[i]) << 8;
    if (i + 1 < bytes.size()) first += std::to_integer<std::uint32_t>(bytes[i + 1]);
    first = (first & 0xffff) + (first >> 16);
    second += first;
    second = (second & 0xffff) + (second >> 16);
  }
  first = (first & 0xffff) + (first >> 16);
  second = (second & 0xffff) + (second >> 16);
  return second << 16 | first;
}

TEST(Fletcher32, OfEverySizeEqualsItsDefinition) {
  std::mt19937 random(2);
  std::vector<std::byte> bytes(3000);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto part = std::span<const std::byte>(bytes).first(size);
    ASSERT_EQ(fletcher32(part), plain_fletcher32(part)) << size;
  }
}

TEST(Fletcher32, OfTheLargestSumsEqualsItsDefinition) {
  for (const int word : {0xffff, 0xfffe, 0x0001, 0x0100}) {
    std::vector<std::byte> bytes(1u << 20);
    for (std::size_t i = 0; i < bytes.size(); i += 2) {
      bytes[i] = static_cast<std::byte>(word >> 8);
      bytes[i + 1] = static_cast<std::byte>(word);
    }
    EXPECT_EQ(fletcher32(bytes), plain_fletcher32(bytes)) << word;
  }
}

}  // namespace
}  // namespace eventgan
