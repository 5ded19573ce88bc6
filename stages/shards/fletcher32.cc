#include "stages/shards/fletcher32.h"

#include <algorithm>

namespace eventgan {
namespace {

/// One step towards x mod 65535. Not `%`: HDF5 folds, so a sum that is a multiple of 65535 stays
/// 0xffff.
std::uint32_t fold(std::uint32_t x) { return (x & 0xffff) + (x >> 16); }

}  // namespace

std::uint32_t fletcher32(std::span<const std::byte> bytes) {
  // A fold leaves first <= 0xffff + 360 x 0xffff / 2^16 and second <= 0x1fffe, so that after this
  // many words second <= 0x1fffe + 360 (0xffff + 360) + 360 x 361 / 2 x 0xffff, still below 2^32.
  constexpr std::size_t kWordsBetweenFolds = 360;
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  const std::size_t even = bytes.size() / 2 * 2;
  for (std::size_t begin = 0; begin < even; begin += 2 * kWordsBetweenFolds) {
    const std::size_t end = std::min(begin + 2 * kWordsBetweenFolds, even);
    for (std::size_t i = begin; i < end; i += 2) {
      first += std::to_integer<std::uint32_t>(bytes[i]) << 8 |
               std::to_integer<std::uint32_t>(bytes[i + 1]);
      second += first;
    }
    first = fold(first);
    second = fold(second);
  }
  if (even != bytes.size()) {
    first += std::to_integer<std::uint32_t>(bytes[even]) << 8;
    second += first;
    first = fold(first);
    second = fold(second);
  }
  return fold(second) << 16 | fold(first);
}

void append_fletcher32(std::vector<std::byte>& bytes) {
  const std::uint32_t sum = fletcher32(bytes);
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::byte>(sum >> shift));
}

bool ends_in_fletcher32(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof(std::uint32_t)) return false;
  const std::size_t size = bytes.size() - sizeof(std::uint32_t);
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < sizeof sum; ++i) {
    sum |= std::to_integer<std::uint32_t>(bytes[size + i]) << (8 * i);
  }
  return sum == fletcher32(bytes.first(size));
}

}  // namespace eventgan
