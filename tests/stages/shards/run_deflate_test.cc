#include "stages/shards/codec/run_deflate.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace eventgan {
namespace {

using Bytes = std::vector<std::byte>;

Bytes deflated(RunDeflater& deflater, const Bytes& bytes) {
  Bytes room(RunDeflater::bound(bytes.size()));
  room.resize(deflater.deflate(bytes, room.data()));
  return room;
}

/// By zlib, which checks the sum at the end too.
Bytes inflated(const Bytes& stream, std::size_t size) {
  Bytes bytes(size + 1);  // one more than there should be
  uLongf found = bytes.size();
  const int result = uncompress(reinterpret_cast<Bytef*>(bytes.data()), &found,
                                reinterpret_cast<const Bytef*>(stream.data()), stream.size());
  EXPECT_EQ(result, Z_OK);
  bytes.resize(found);
  return bytes;
}

/// Of so many, on average this share is not zero, in steps of 1/256.
Bytes random_bytes(std::size_t size, unsigned nonzero, unsigned seed) {
  std::mt19937 random(seed);
  Bytes bytes(size);
  for (std::byte& byte : bytes) {
    if (random() % 256 < nonzero) byte = static_cast<std::byte>(random());
  }
  return bytes;
}

TEST(RunDeflater, ZlibReadsWhatItWrote) {
  RunDeflater deflater;
  constexpr std::size_t kCoded = std::size_t{1} << 18;  // what shares its codes
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, std::size_t{63}, std::size_t{64}, std::size_t{65},
        std::size_t{65535}, std::size_t{65536}, kCoded - 1, kCoded, kCoded + 1, 3 * kCoded + 77}) {
    for (const unsigned nonzero : {0u, 1u, 20u, 128u, 256u}) {
      const Bytes bytes = random_bytes(size, nonzero, nonzero + 1);
      EXPECT_EQ(inflated(deflated(deflater, bytes), size), bytes) << size << ", " << nonzero;
    }
  }
}

/// Each length of a run has its own way to be written: literals, a match, several matches.
TEST(RunDeflater, RunsOfEveryLength) {
  RunDeflater deflater;
  Bytes bytes;
  for (std::size_t zeros = 0; zeros < 1100; ++zeros) {
    bytes.resize(bytes.size() + zeros);
    bytes.push_back(static_cast<std::byte>(1 + zeros % 255));
  }
  EXPECT_EQ(inflated(deflated(deflater, bytes), bytes.size()), bytes);
  for (std::size_t zeros = 250; zeros < 1050; ++zeros) {  // at the end
    const Bytes some(zeros);
    EXPECT_EQ(inflated(deflated(deflater, some), zeros), some) << zeros;
  }
}

TEST(RunDeflater, EmptyVolumesAreNearlyNothing) {
  RunDeflater deflater;
  const Bytes zeros(8'000'000);
  // A match of 258 zeros takes no less than 2 bits: 7,752 bytes; and the codes.
  EXPECT_LT(deflated(deflater, zeros).size(), 7'752u + 200u);
}

/// A block ends with the 256 KiB that give it 65,536 literals, or after 16 MiB.
TEST(RunDeflater, BlocksOfEverySize) {
  RunDeflater deflater;
  for (const std::size_t size : {(1u << 18) - 1, 1u << 18, (1u << 18) + 1, (1u << 24) - 1, 1u << 24,
                                 (1u << 24) + 1, (1u << 24) + (1u << 18) + 65}) {
    Bytes bytes(size);
    bytes.front() = bytes.back() = bytes[size / 2] = std::byte{3};
    EXPECT_EQ(inflated(deflated(deflater, bytes), size), bytes) << size;
    const Bytes dense = random_bytes(300'000, 200, 7);  // behind what is nearly empty
    bytes.insert(bytes.end(), dense.begin(), dense.end());
    EXPECT_EQ(inflated(deflated(deflater, bytes), bytes.size()), bytes) << size;
  }
}

/// Bytes without a pattern get no smaller: five bytes more for each 65,535, and a few for all.
TEST(RunDeflater, StoresWhatGetsNoSmaller) {
  RunDeflater deflater;
  const Bytes bytes = random_bytes(1'000'000, 256, 5);
  const std::size_t size = deflated(deflater, bytes).size();
  EXPECT_GE(size, bytes.size());
  EXPECT_LE(size, bytes.size() + 5 * 20 + 11);
}

/// A volume's planes hold little that repeats but zeros: zlib finds no more in them at its level 1.
TEST(RunDeflater, IsNoLargerThanWithASearchForMatches) {
  RunDeflater deflater;
  std::mt19937 random(3);
  std::gamma_distribution<double> magnitude(1.3, 30);
  Bytes bytes(2'000'000);
  for (std::size_t from = 0; from < bytes.size(); from += 40) {
    if (random() % 6 != 0) continue;
    for (std::size_t i = from; i < from + 40; ++i) {
      if (random() % 2 == 0) bytes[i] = static_cast<std::byte>(std::min(magnitude(random), 255.0));
    }
  }
  Bytes searched(compressBound(bytes.size()));
  uLongf size = searched.size();
  ASSERT_EQ(compress2(reinterpret_cast<Bytef*>(searched.data()), &size,
                      reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), 1),
            Z_OK);
  EXPECT_LT(deflated(deflater, bytes).size(), size);
}

/// The codes are chosen from a sample: what it does not show can still be written.
TEST(RunDeflater, WhatTheSampleDoesNotShow) {
  RunDeflater deflater;
  Bytes bytes(100'000, std::byte{7});
  for (std::size_t i = 300; i < 556; ++i) bytes[i] = static_cast<std::byte>(i);
  EXPECT_EQ(inflated(deflated(deflater, bytes), bytes.size()), bytes);
}

}  // namespace
}  // namespace eventgan
