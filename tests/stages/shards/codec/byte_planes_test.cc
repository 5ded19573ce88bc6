#include "stages/shards/codec/byte_planes.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

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

}  // namespace
}  // namespace eventgan
