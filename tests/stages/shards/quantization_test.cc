#include "stages/shards/codec/quantization.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace eventgan {
namespace {

TEST(HalfFloat, HasTheTextbookValues) {
  EXPECT_EQ(from_half(0x0000), 0.0f);
  EXPECT_EQ(from_half(0x3c00), 1.0f);
  EXPECT_EQ(from_half(0xc000), -2.0f);
  EXPECT_EQ(from_half(0x3555), 0.333251953125f);
  EXPECT_EQ(from_half(0x7bff), kLargestHalf);
  EXPECT_EQ(from_half(0x0400), 0x1p-14f);
  EXPECT_EQ(from_half(0x0001), 0x1p-24f);
  EXPECT_EQ(from_half(0x7c00), std::numeric_limits<float>::infinity());
  EXPECT_TRUE(std::isnan(from_half(0x7e00)));
}

TEST(HalfFloat, EveryHalfSurvives) {
  for (std::uint16_t half = 0; half <= 0x7bff; ++half) {
    ASSERT_EQ(to_half(from_half(half)), half) << half;
  }
  std::vector<std::uint16_t> halves(0x7c01);  // up to infinity, and no multiple of eight
  std::iota(halves.begin(), halves.end(), 0);
  std::vector<float> values(halves.size());
  from_halves(halves, values.data());
  for (std::size_t i = 0; i < halves.size(); ++i) ASSERT_EQ(values[i], from_half(halves[i]));
}

TEST(HalfFloat, RoundsToTheNearestTiesToEven) {
  // Between every two neighbours: the middle goes to the even one, what is next to the middle to
  // its side.
  for (std::uint16_t half = 0; half < 0x7bff; ++half) {
    const float low = from_half(half);
    const float high = from_half(half + 1);
    const float middle = low + (high - low) / 2;  // exact: float has 13 more bits
    const std::uint16_t even = half % 2 == 0 ? half : half + 1;
    ASSERT_EQ(to_half(middle), even) << middle;
    ASSERT_EQ(to_half(std::nextafter(middle, low)), half) << middle;
    ASSERT_EQ(to_half(std::nextafter(middle, high)), half + 1) << middle;
  }
}

TEST(HalfFloat, SmallestNumbersBecomeZero) {
  EXPECT_EQ(to_half(std::numeric_limits<float>::denorm_min()), 0);
  EXPECT_EQ(to_half(0x1p-25f), 0);  // tie
  EXPECT_EQ(to_half(-0.0f), 0);
}

/// Whatever the processor converts with must round as to_half does: every half, the middles between
/// them, their neighbours, and numbers of all magnitudes.
TEST(HalfFloat, ManyAtOnceAreTheSameBits) {
  std::vector<float> values;
  for (std::uint16_t half = 0; half < 0x7bff; ++half) {
    const float low = from_half(half);
    const float middle = low + (from_half(half + 1) - low) / 2;
    for (const float value :
         {low, middle, std::nextafter(middle, 0.0f), std::nextafter(middle, 1e9f)}) {
      values.push_back(value);
    }
  }
  std::mt19937 random(8);
  for (int i = 0; i < 100000; ++i) {
    values.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(random() % 0x7f800000u)));
  }
  values.insert(values.end(), {-0.0f, std::numeric_limits<float>::max(), kLargestHalf, 65520.0f});
  std::vector<std::uint16_t> halves(values.size());
  to_halves(values, halves.data());
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_EQ(halves[i], to_half(std::min(values[i], kLargestHalf))) << values[i];
  }
}

TEST(HalfFloat, AnyNumberAtOnceAndNothingBehindThem) {
  for (std::size_t count = 0; count < 40; ++count) {
    const std::vector<float> values(count, 2.0f);
    std::vector<std::uint16_t> halves(count + 1, 7);
    to_halves(values, halves.data());
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(halves[i], 0x4000);
    ASSERT_EQ(halves[count], 7);
  }
}

float largest(const std::vector<float>& values) {
  return values.empty() ? 0.0f : *std::max_element(values.begin(), values.end());
}

/// The stored numbers one after another, as they are before HDF5's filter shuffle.
std::vector<std::byte> stored_bytes(const std::vector<float>& values, StoredType type) {
  const std::size_t size = stored_size(type);
  std::vector<std::byte> planes(values.size() * size);
  quantize(values, quantization(type, largest(values)), planes.data(), values.size());
  std::vector<std::byte> bytes(planes.size());
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = planes[i % size * values.size() + i / size];
  }
  return bytes;
}

std::vector<float> there_and_back(const std::vector<float>& values, StoredType type) {
  std::vector<float> read(values.size());
  dequantize(stored_bytes(values, type), type, quantization(type, largest(values)).scale, read);
  return read;
}

TEST(Quantization, Float32IsExactAndFloat16ClipsToItsLargestNumberAndSaysSo) {
  const std::vector<float> values{0, 1e-40f, 0.1f, 3e38f};
  EXPECT_EQ(there_and_back(values, StoredType::kFloat32), values);
  const std::vector<float> fits{0, 0.5f, 65504};
  EXPECT_EQ(there_and_back(fits, StoredType::kFloat16), fits);
  EXPECT_FALSE(quantization(StoredType::kFloat16, 65504).saturated);
  // 65536 would be infinity.
  const std::vector<float> beyond{1, 65536, 3e38f};
  EXPECT_EQ(there_and_back(beyond, StoredType::kFloat16), (std::vector<float>{1, 65504, 65504}));
  EXPECT_TRUE(quantization(StoredType::kFloat16, std::nextafter(65504.0f, 1e9f)).saturated);
}

TEST(Quantization, Uint8SpreadsItsCodesUpToTheLargestValue) {
  // Largest 51: scale 51 / 255 = 0.2. Codes: 0.2 → 1; 0.09 → 0; 0.11 → 1.
  EXPECT_EQ(quantization(StoredType::kUint8, 51).scale, 0.2f);
  const std::vector<std::byte> codes{std::byte{0}, std::byte{255}, std::byte{1}, std::byte{0},
                                     std::byte{1}};
  EXPECT_EQ(stored_bytes({0, 51, 0.2f, 0.09f, 0.11f}, StoredType::kUint8), codes);
  EXPECT_FALSE(quantization(StoredType::kUint8, 3e38f).saturated);
}

TEST(Quantization, Uint8IsWithinHalfAStep) {
  for (const float largest : {1e-30f, 0.7f, 1.0f, 1234.5f, 3e38f}) {
    std::vector<float> values;
    for (int i = 0; i <= 1000; ++i) values.push_back(largest * (static_cast<float>(i) / 1000));
    const std::vector<float> back = there_and_back(values, StoredType::kUint8);
    const double half_step = largest / 255.0 / 2;
    for (std::size_t i = 0; i < values.size(); ++i) {
      ASSERT_NEAR(back[i], values[i], half_step * (1 + 1e-4)) << largest;
    }
    EXPECT_NEAR(back.back(), largest, largest * 1e-6);
  }
}

TEST(Quantization, SaysWhenNothingIsLeftOfTheValues) {
  // The smallest half is 2^-24; half of it goes to even, zero.
  EXPECT_TRUE(quantization(StoredType::kFloat16, 0x1p-25f).vanished);
  EXPECT_FALSE(quantization(StoredType::kFloat16, std::nextafter(0x1p-25f, 1.0f)).vanished);
  // The smallest step of uint8 is the smallest normal float, 2^-126.
  EXPECT_TRUE(quantization(StoredType::kUint8, std::nextafter(0x1p-127f, 0.0f)).vanished);
  EXPECT_FALSE(quantization(StoredType::kUint8, 0x1p-127f).vanished);
  EXPECT_FALSE(quantization(StoredType::kFloat32, 0x1p-149f).vanished);
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    EXPECT_FALSE(quantization(type, 0).vanished) << "there were none";
    EXPECT_FALSE(quantization(type, 1e30f).vanished);
  }
}

TEST(Quantization, Uint8OfNothingAndOfNextToNothing) {
  EXPECT_EQ(quantization(StoredType::kUint8, 0).scale, 1);
  // A step of 1e-40 / 255 does not exist; the values become zero, not NaN and not 255.
  EXPECT_EQ(there_and_back({1e-40f, 0}, StoredType::kUint8), (std::vector<float>{0, 0}));
  EXPECT_TRUE(stored_bytes({}, StoredType::kUint8).empty());
}

/// All magnitudes up to `largest`, and the numbers next to where codes change.
std::vector<float> dense_values(float largest, float scale) {
  std::mt19937 random(6);
  std::vector<float> values{0, -0.0f, largest};
  for (int i = 0; i < 20000; ++i) {
    const std::uint32_t bits = random() % (std::bit_cast<std::uint32_t>(largest) + 1);
    values.push_back(std::bit_cast<float>(bits));
  }
  for (int code = 0; code < 255; ++code) {
    const float step = std::min((static_cast<float>(code) + 0.5f) * scale, largest);
    for (const float value : {std::nextafter(step, 0.0f), step, std::nextafter(step, largest)}) {
      values.push_back(value);
    }
  }
  return values;
}

TEST(Quantization, Uint8EqualsItsDefinitionForEveryMagnitude) {
  for (const float top :
       {1e-42f, 1e-36f, 0.3f, 1.0f, 65504.0f, std::numeric_limits<float>::max()}) {
    const float scale = std::max(top / 255, std::numeric_limits<float>::min());
    ASSERT_EQ(quantization(StoredType::kUint8, top).scale, scale);
    const std::vector<float> values = dense_values(top, scale);
    const std::vector<std::byte> codes = stored_bytes(values, StoredType::kUint8);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const float position = values[i] / scale + 0.5f;
      const int code = position >= 255 ? 255 : static_cast<int>(position);
      ASSERT_EQ(std::to_integer<int>(codes[i]), code) << values[i] << " of " << top;
    }
  }
}

TEST(Quantization, FloatsEqualTheirDefinitionInEveryPlace) {
  // More values than are converted at once, and a rest that no vector instruction takes.
  std::vector<float> values = dense_values(1e5f, 1.0f);
  values.resize(20 * 1024 + 13);
  const auto halves = stored_bytes(values, StoredType::kFloat16);
  const auto floats = stored_bytes(values, StoredType::kFloat32);
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint16_t half;
    std::memcpy(&half, halves.data() + 2 * i, sizeof half);
    ASSERT_EQ(half, to_half(std::min(values[i], kLargestHalf))) << values[i];
  }
  EXPECT_EQ(std::memcmp(floats.data(), values.data(), floats.size()), 0);  // -0 too
}

}  // namespace
}  // namespace eventgan
