#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace eventgan {

/// The checksum of HDF5's filter fletcher32, to be appended to the bytes in little endian:
/// Fletcher's sums modulo 65535 over big-endian 16-bit words, an odd last byte taken as the high
/// half of a word; the second sum in the high half of the result. Thread safe.
std::uint32_t fletcher32(std::span<const std::byte> bytes);

}  // namespace eventgan
