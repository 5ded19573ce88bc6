#include "stages/shards/codec/volume_codec.h"

#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <thread>

#include "stages/shards/codec/fletcher32.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

/// About half zeros, the rest in [0, 1): what generated volumes look like.
std::vector<float> some_volume(std::size_t size) {
  std::mt19937 random(3);
  std::vector<float> values(size);
  for (float& value : values) {
    value = std::max(0.0f, static_cast<float>(random() % 2001) / 1000 - 1);
  }
  return values;
}

/// The numbers HDF5's own filters make of a chunk; `element` = HDF5's type of them.
template <class Number>
std::vector<Number> decoded_by_hdf5(const std::vector<std::byte>& chunk, std::size_t count,
                                    hid_t element, int deflate_level) {
  const testing::TemporaryFolder folder;
  const hsize_t size = count;
  const hid_t file = H5Fcreate((folder / "x.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(creation, 1, &size);
  H5Pset_shuffle(creation);
  if (deflate_level > 0) H5Pset_deflate(creation, static_cast<unsigned>(deflate_level));
  H5Pset_fletcher32(creation);
  const hid_t space = H5Screate_simple(1, &size, nullptr);
  const hid_t dataset = H5Dcreate2(file, "d", element, space, H5P_DEFAULT, creation, H5P_DEFAULT);
  const hsize_t offset = 0;
  EXPECT_GE(H5Dwrite_chunk(dataset, H5P_DEFAULT, 0, &offset, chunk.size(), chunk.data()), 0);
  std::vector<Number> numbers(count);
  EXPECT_GE(H5Dread(dataset, element, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()), 0);
  H5Dclose(dataset);
  H5Sclose(space);
  H5Pclose(creation);
  H5Fclose(file);
  return numbers;
}

class VolumeCodecLevels : public ::testing::TestWithParam<int> {};

TEST_P(VolumeCodecLevels, Hdf5ReadsEveryType) {
  const int level = GetParam();
  for (const std::size_t size : {1u, 7u, 5000u}) {
    const std::vector<float> values = some_volume(size);
    EXPECT_EQ(decoded_by_hdf5<float>(VolumeCodec(StoredType::kFloat32, level).encode(values).chunk,
                                     size, H5T_IEEE_F32LE, level),
              values);
    // uint8 and float16 as the integers that hold their bits.
    const EncodedVolume bytes = VolumeCodec(StoredType::kUint8, level).encode(values);
    const auto codes = decoded_by_hdf5<std::uint8_t>(bytes.chunk, size, H5T_STD_U8LE, level);
    const auto halves = decoded_by_hdf5<std::uint16_t>(
        VolumeCodec(StoredType::kFloat16, level).encode(values).chunk, size, H5T_STD_U16LE, level);
    for (std::size_t i = 0; i < size; ++i) {
      ASSERT_NEAR(codes[i] * bytes.scale, values[i], bytes.scale * 0.50001);
      ASSERT_EQ(halves[i] == 0, values[i] == 0);
    }
  }
}

TEST_P(VolumeCodecLevels, AChunkIsDecodedToTheNumbersThatHdf5Reads) {
  const int level = GetParam();
  const std::vector<float> values = some_volume(5000);
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    const std::vector<std::byte> chunk = VolumeCodec(type, level).encode(values).chunk;
    const std::size_t size = values.size() * stored_size(type);
    const auto numbers = decode_chunk(chunk, type, level, size);
    ASSERT_TRUE(numbers);
    std::vector<std::byte> expected(size);
    const auto keep = [&](const auto& read) { std::memcpy(expected.data(), read.data(), size); };
    if (type == StoredType::kFloat32) {
      keep(decoded_by_hdf5<float>(chunk, values.size(), H5T_IEEE_F32LE, level));
    } else if (type == StoredType::kFloat16) {
      keep(decoded_by_hdf5<std::uint16_t>(chunk, values.size(), H5T_STD_U16LE, level));
    } else {
      keep(decoded_by_hdf5<std::uint8_t>(chunk, values.size(), H5T_STD_U8LE, level));
    }
    EXPECT_EQ(*numbers, expected);

    // Another size; a flipped bit; a sound checksum over what does not inflate, or to less.
    EXPECT_FALSE(decode_chunk(chunk, type, level, size - stored_size(type)));
    EXPECT_FALSE(decode_chunk(chunk, type, level, size + stored_size(type)));
    std::vector<std::byte> damaged = chunk;
    damaged[damaged.size() / 2] ^= std::byte{8};
    EXPECT_FALSE(decode_chunk(damaged, type, level, size));
    damaged = {std::byte{7}, std::byte{9}};
    append_fletcher32(damaged);
    EXPECT_FALSE(decode_chunk(damaged, type, level, size));
    EXPECT_FALSE(decode_chunk({}, type, level, size));
  }
}

INSTANTIATE_TEST_SUITE_P(Deflate, VolumeCodecLevels, ::testing::Values(0, 1, 6, 9));

TEST(VolumeCodec, WithoutDeflateTheChunkIsShuffledBytesAndAChecksum) {
  // 1.0f = 00 00 80 3f, 2.0f = 00 00 00 40 in little endian; shuffled: 00 00 | 00 00 | 80 00 |
  // 3f 40. Fletcher over the words 0000 0000 8000 3f40: first = bf40, second = 8000 + bf40 = 13f40
  // → 3f41.
  const std::vector<std::byte> chunk =
      VolumeCodec(StoredType::kFloat32, 0).encode(std::vector<float>{1, 2}).chunk;
  const unsigned char expected[] = {0, 0, 0, 0, 0x80, 0, 0x3f, 0x40, 0x40, 0xbf, 0x41, 0x3f};
  ASSERT_EQ(chunk.size(), sizeof(expected));
  EXPECT_EQ(std::memcmp(chunk.data(), expected, sizeof(expected)), 0);
}

TEST(VolumeCodec, DeflateMakesZerosSmallAndNoiseHardlyLarger) {
  const VolumeCodec codec(StoredType::kFloat32, 1);
  const std::vector<float> zeros(100000);
  EXPECT_LT(codec.encode(zeros).chunk.size(), 2000u);
  std::mt19937 random(5);
  std::vector<float> noise(100000);
  for (float& value : noise) {
    const std::uint32_t bits = random() & 0x7f7fffff;  // any finite number >= 0
    std::memcpy(&value, &bits, sizeof(bits));
  }
  EXPECT_LT(codec.encode(noise).chunk.size(), 401000u);
}

TEST(VolumeCodec, SameVolumeSameBytes) {
  const std::vector<float> values = some_volume(30000);
  const VolumeCodec codec(StoredType::kFloat16, 4);
  EXPECT_EQ(codec.encode(values).chunk, codec.encode(values).chunk);
}

TEST(VolumeCodec, PassesOnScaleAndSaturation) {
  EXPECT_EQ(VolumeCodec(StoredType::kUint8, 1).encode(std::vector<float>{510}).scale, 2);
  EXPECT_TRUE(VolumeCodec(StoredType::kFloat16, 1).encode(std::vector<float>{1e6}).saturated);
}

TEST(VolumeCodec, RefusesWhatNoVolumeMayHold) {
  for (const float bad : {-0.1f, std::nanf(""), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
    for (const auto type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
      const VolumeCodec codec(type, 1);
      EXPECT_THROW(codec.encode(std::vector<float>{0, bad, 1}), std::invalid_argument) << bad;
      EXPECT_THROW(codec.encode(std::vector<float>{0, 1, bad}), std::invalid_argument) << bad;
    }
  }
}

/// The window's values copied into a volume of zeros.
std::vector<float> framed(const std::vector<float>& values, const VolumeWindow& window) {
  const ImageSize whole = window.whole.size;
  const ImageSize content = window.content;
  std::vector<float> volume(window.whole.value_count());
  std::size_t next = 0;
  for (int channel = 0; channel < window.whole.channels(); ++channel) {
    for (int y = 0; y < content.height; ++y) {
      for (int x = 0; x < content.width; ++x) {
        const int row = channel * whole.height + window.y + y;
        volume[static_cast<std::size_t>(row) * whole.width + window.x + x] = values[next++];
      }
    }
  }
  return volume;
}

TEST(VolumeCodec, AWindowIsWhatItWouldBeWithZerosAroundIt) {
  const VolumeShape shape{2, {7, 9}};
  const VolumeWindow windows[] = {{shape, {7, 9}, 0, 0},  // all of it
                                  {shape, {3, 9}, 0, 2},  // borders above and below
                                  {shape, {7, 4}, 3, 0},  // left and right
                                  {shape, {5, 1}, 8, 1},  // a column of pixels
                                  {shape, {1, 1}, 0, 6}, {shape, {0, 0}, 0, 0},
                                  {shape, {0, 9}, 0, 3}, {shape, {7, 0}, 4, 0}};
  for (const auto type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    for (const int level : {0, 1, 6}) {
      const VolumeCodec codec(type, level);
      for (const VolumeWindow& window : windows) {
        // Working memory that other volumes went through must not show.
        codec.encode(std::vector<float>(shape.value_count(), 1.0f));
        const std::vector<float> values = some_volume(window.value_count());
        const float largest =
            values.empty() ? 0.0f : *std::max_element(values.begin(), values.end());
        const EncodedVolume got = codec.encode(values, window, largest);
        const EncodedVolume expected = codec.encode(framed(values, window));
        ASSERT_EQ(got.chunk, expected.chunk)
            << window.content.height << " " << window.content.width;
        EXPECT_EQ(got.scale, expected.scale);
      }
    }
  }
}

TEST(VolumeCodec, RefusesAWindowThatDoesNotFit) {
  const VolumeCodec codec(StoredType::kUint8, 1);
  const VolumeShape shape{1, {2, 2}};
  const std::vector<float> four(4);
  EXPECT_THROW(codec.encode(four, {shape, {1, 2}, 1, 0}, 0), std::invalid_argument);
  EXPECT_THROW(codec.encode(four, {shape, {2, 1}, 0, 1}, 0), std::invalid_argument);
  EXPECT_THROW(codec.encode(four, {shape, {1, 2}, 0, -1}, 0), std::invalid_argument);
  EXPECT_THROW(codec.encode(four, {shape, {1, 1}, 0, 0}, 0), std::invalid_argument);
}

TEST(VolumeCodec, ManyThreadsGetTheBytesOfOne) {
  const VolumeCodec codec(StoredType::kFloat16, 1);
  std::vector<std::vector<std::byte>> expected;
  for (std::size_t i = 0; i < 6; ++i) expected.push_back(codec.encode(some_volume(500 * i)).chunk);
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (std::size_t thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&, thread] {
      for (std::size_t i = 0; i < 24; ++i) {
        const std::size_t which = (i + thread) % expected.size();
        if (codec.encode(some_volume(500 * which)).chunk != expected[which]) ++wrong;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(VolumeCodec, RefusesLevelsThatDoNotExist) {
  EXPECT_THROW(VolumeCodec(StoredType::kUint8, -1), std::invalid_argument);
  EXPECT_THROW(VolumeCodec(StoredType::kUint8, 10), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
