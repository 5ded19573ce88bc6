#include "stages/shards/quantization.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace eventgan {
namespace {

std::vector<float> there_and_back(const std::vector<float>& values, StoredType type) {
  const QuantizedVolume stored = quantize(values, type);
  EXPECT_EQ(stored.bytes.size(), values.size() * stored_size(type));
  return dequantize(stored.bytes, type, stored.scale);
}

TEST(Quantization, Float32IsExact) {
  const std::vector<float> values{0, 1e-40f, 0.1f, 3e38f};
  EXPECT_EQ(there_and_back(values, StoredType::kFloat32), values);
}

TEST(Quantization, Float16ClipsToItsLargestNumberAndSaysSo) {
  const std::vector<float> fits{0, 0.5f, 65504};
  EXPECT_EQ(there_and_back(fits, StoredType::kFloat16), fits);
  EXPECT_FALSE(quantize(fits, StoredType::kFloat16).saturated);
  // 65536 would be infinity.
  const std::vector<float> beyond{1, 65536, 3e38f};
  EXPECT_EQ(there_and_back(beyond, StoredType::kFloat16), (std::vector<float>{1, 65504, 65504}));
  EXPECT_TRUE(quantize(beyond, StoredType::kFloat16).saturated);
}

TEST(Quantization, Uint8SpreadsItsCodesUpToTheLargestValue) {
  // Largest 51: scale 51 / 255 = 0.2. Codes: 0.2 → 1; 0.09 → 0; 0.11 → 1.
  const QuantizedVolume stored =
      quantize(std::vector<float>{0, 51, 0.2f, 0.09f, 0.11f}, StoredType::kUint8);
  EXPECT_EQ(stored.scale, 0.2f);
  const std::vector<std::byte> codes{std::byte{0}, std::byte{255}, std::byte{1}, std::byte{0},
                                     std::byte{1}};
  EXPECT_EQ(stored.bytes, codes);
  EXPECT_FALSE(stored.saturated);
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

TEST(Quantization, Uint8OfNothingAndOfNextToNothing) {
  EXPECT_EQ(quantize(std::vector<float>{0, 0}, StoredType::kUint8).scale, 1);
  // A step of 1e-40 / 255 does not exist; the values become zero, not NaN and not 255.
  EXPECT_EQ(there_and_back({1e-40f, 0}, StoredType::kUint8), (std::vector<float>{0, 0}));
  EXPECT_TRUE(quantize({}, StoredType::kUint8).bytes.empty());
}

TEST(Quantization, RefusesWhatNoVolumeMayHold) {
  for (const float bad : {-0.1f, std::nanf(""), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
    for (const auto type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
      EXPECT_THROW(quantize(std::vector<float>{0, bad, 1}, type), std::invalid_argument) << bad;
    }
  }
}

}  // namespace
}  // namespace eventgan
