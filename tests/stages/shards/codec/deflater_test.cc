#include "stages/shards/codec/deflater.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace eventgan {
namespace {

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

}  // namespace
}  // namespace eventgan
