#include "stages/shards/codec/byte_planes.h"

namespace eventgan {
namespace {

/// One loop a plane: each is a shift and a narrowing, which become vector instructions. Bytes may
/// alias anything, so the compiler must be told that the planes are not the numbers.
template <class Number>
void split(std::span<const Number> numbers, std::byte* planes, std::size_t plane_size) {
  const Number* __restrict in = numbers.data();
  const std::size_t count = numbers.size();
  for (std::size_t byte = 0; byte < sizeof(Number); ++byte) {
    std::byte* __restrict out = planes + byte * plane_size;
    const int shift = static_cast<int>(8 * byte);
    for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::byte>(in[i] >> shift);
  }
}

}  // namespace

void split_into_planes(std::span<const std::uint16_t> numbers, std::byte* planes,
                       std::size_t plane_size) {
  split(numbers, planes, plane_size);
}

void split_into_planes(std::span<const std::uint32_t> numbers, std::byte* planes,
                       std::size_t plane_size) {
  split(numbers, planes, plane_size);
}

}  // namespace eventgan
