#include "stages/shards/codec/volume_codec.h"

#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "stages/shards/codec/chunk_filters.h"
#include "stages/shards/codec/quantization.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

template <class Number>
void expect_shuffled(std::size_t count) {
  std::mt19937 random(static_cast<unsigned>(count));
  std::vector<Number> numbers(count);
  for (Number& number : numbers) number = static_cast<Number>(random());
  // Planes longer than the numbers: what lies between must stay.
  const std::size_t plane_size = count + 3;
  const std::byte untouched{0xa5};
  std::vector<std::byte> planes(plane_size * sizeof(Number), untouched);
  split_into_planes(std::span<const Number>(numbers), planes.data(), plane_size);
  for (std::size_t byte = 0; byte < sizeof(Number); ++byte) {
    for (std::size_t i = 0; i < plane_size; ++i) {
      const std::byte expected =
          i < count ? static_cast<std::byte>(numbers[i] >> (8 * byte)) : untouched;
      ASSERT_EQ(planes[byte * plane_size + i], expected) << byte << " " << i << " of " << count;
    }
  }
}

TEST(BytePlanes, HoldTheBytesOfEachSignificanceLowestFirst) {
  for (const std::size_t count : {0u, 1u, 2u, 15u, 16u, 17u, 63u, 64u, 65u, 1000u}) {
    expect_shuffled<std::uint16_t>(count);
    expect_shuffled<std::uint32_t>(count);
  }
}

std::vector<std::byte> noise(std::size_t size, unsigned values) {
  std::mt19937 random(static_cast<unsigned>(size) + values);
  std::vector<std::byte> bytes(size);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % values);
  return bytes;
}

TEST(Deflater, WhatCameBeforeDoesNotMatter) {
  // Incompressible, repetitive, short, empty, in all orders: the bytes of a fresh compressor.
  const std::vector<std::vector<std::byte>> inputs = {
      noise(40000, 256), noise(9000, 3), std::vector<std::byte>(20000), noise(5, 9), {}};
  for (int level = 1; level <= 9; ++level) {
    std::vector<std::vector<std::byte>> fresh;
    for (const auto& input : inputs) {
      Deflater deflater(level);
      const auto bytes = deflater.deflate(input);
      fresh.emplace_back(bytes.begin(), bytes.end());
    }
    Deflater used(level);
    for (std::size_t before = 0; before < inputs.size(); ++before) {
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        used.deflate(inputs[before]);
        const auto bytes = used.deflate(inputs[i]);
        ASSERT_EQ(std::vector<std::byte>(bytes.begin(), bytes.end()), fresh[i])
            << "level " << level << ", input " << i << " after " << before;
      }
    }
  }
}

/// Leaves `value` where the next calls have their variables.
[[gnu::noinline]] void fill_stack(std::uint16_t value) {
  std::array<volatile std::uint16_t, 128 * 1024> below;
  for (volatile std::uint16_t& word : below) word = value;
}

TEST(Deflater, WhatLayInMemoryDoesNotMatter) {
  const std::vector<std::byte> input = noise(200000, 3);
  for (int level = 1; level <= 9; ++level) {
    std::vector<std::byte> first;
    for (const std::uint16_t value : {0, 1, 9, 14, 65535}) {
      fill_stack(value);
      Deflater deflater(level);
      fill_stack(value);
      const auto bytes = deflater.deflate(input);
      if (first.empty()) first.assign(bytes.begin(), bytes.end());
      ASSERT_EQ(std::vector<std::byte>(bytes.begin(), bytes.end()), first)
          << "level " << level << ", memory of " << value;
    }
  }
}

TEST(Deflater, WhereItLiesInMemoryDoesNotMatter) {
  std::vector<std::vector<std::byte>> inputs;
  for (unsigned i = 0; i < 40; ++i) {
    inputs.push_back(noise(300 + 29 * i, 256));
    for (std::size_t place = 0; place < inputs[i].size(); ++place) {
      if (place % 5 > 1) inputs[i][place] = std::byte{0};
    }
  }
  std::vector<std::vector<std::byte>> first(inputs.size());
  std::vector<std::unique_ptr<Deflater>> deflaters;  // kept, so that each has another address
  for (int count = 0; count < 400; ++count) {
    deflaters.push_back(std::make_unique<Deflater>(1));
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const auto bytes = deflaters.back()->deflate(inputs[i]);
      if (count == 0) first[i].assign(bytes.begin(), bytes.end());
      ASSERT_EQ(std::vector<std::byte>(bytes.begin(), bytes.end()), first[i])
          << "deflater " << count << ", input " << i;
    }
  }
}

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
    constexpr float kScale = 0.375;
    std::vector<float> volume(values.size()), of_numbers(values.size());
    EXPECT_TRUE(decode_volume(chunk, type, level, kScale, volume));
    dequantize(expected, type, kScale, of_numbers);
    EXPECT_EQ(volume, of_numbers);

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
    EXPECT_FALSE(decode_volume(damaged, type, level, kScale, volume));
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

TEST(VolumeCodec, HigherLevelsAreSmaller) {
  // Patches of a few pixels at random places, many alike: as in volumes, and unlike noise, which
  // no level makes much smaller.
  std::mt19937 random(6);
  const std::vector<float> patches = some_volume(2000);
  std::vector<float> values(200000);
  for (int i = 0; i < 4000; ++i) {
    std::copy_n(&patches[random() % 1990], 10, &values[random() % (values.size() - 10)]);
  }
  for (const auto type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    std::vector<std::size_t> sizes;
    for (const int level : {0, 1, 2, 6}) {
      sizes.push_back(VolumeCodec(type, level).encode(values).chunk.size());
    }
    EXPECT_TRUE(std::ranges::is_sorted(sizes, std::greater<>())) << ::testing::PrintToString(sizes);
  }
}

TEST(VolumeCodec, SameVolumeSameBytesScaleAndSaturation) {
  const std::vector<float> values = some_volume(30000);
  for (const int level : {1, 4}) {
    const VolumeCodec codec(StoredType::kFloat16, level);
    EXPECT_EQ(codec.encode(values).chunk, codec.encode(values).chunk);
  }
  EXPECT_EQ(VolumeCodec(StoredType::kUint8, 1).encode(std::vector<float>{510}).scale, 2);
  EXPECT_TRUE(VolumeCodec(StoredType::kFloat16, 1).encode(std::vector<float>{1e6}).saturated);
}

TEST(VolumeCodec, RefusesWhatNoVolumeMayHold) {
  for (const float bad : {-0.1f, std::nanf(""), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
    for (const auto type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
      const VolumeCodec codec(type, 1);
      EXPECT_THROWS(codec.encode(std::vector<float>{0, bad, 1}), std::invalid_argument,
                    "expected finite values >= 0 in a volume to store, got others")
          << bad;
      EXPECT_THROWS(codec.encode(std::vector<float>{0, 1, bad}), std::invalid_argument,
                    "expected finite values >= 0 in a volume to store, got others")
          << bad;
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
  EXPECT_THROWS(codec.encode(four, {shape, {1, 2}, 1, 0}, 0), std::invalid_argument,
                "expected a window inside of the volume, got one across its");
  EXPECT_THROWS(codec.encode(four, {shape, {2, 1}, 0, 1}, 0), std::invalid_argument,
                "expected a window inside of the volume, got one across its");
  EXPECT_THROWS(codec.encode(four, {shape, {1, 2}, 0, -1}, 0), std::invalid_argument,
                "expected a window inside of the volume, got one across its");
  EXPECT_THROWS(codec.encode(four, {shape, {1, 1}, 0, 0}, 0), std::invalid_argument,
                "expected 2 values, got 4");
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
  EXPECT_THROWS(VolumeCodec(StoredType::kUint8, -1), std::invalid_argument,
                "expected a deflate level 0..9, got -1");
  EXPECT_THROWS(VolumeCodec(StoredType::kUint8, 10), std::invalid_argument,
                "expected a deflate level 0..9, got 10");
}

}  // namespace
}  // namespace eventgan
