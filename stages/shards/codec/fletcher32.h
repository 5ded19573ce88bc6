#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace eventgan {

/// The checksum of HDF5's filter fletcher32: Fletcher's sums modulo 65535 over big-endian 16-bit
/// words, an odd last byte taken as the high half of a word; the second sum in the high half of the
/// result. Thread safe.
std::uint32_t fletcher32(std::span<const std::byte> bytes);

/// Appends it as the filter does, in little endian.
void append_fletcher32(std::vector<std::byte>& bytes);

/// Whether `bytes` ends in the checksum of what stands before it.
bool ends_in_fletcher32(std::span<const std::byte> bytes);

}  // namespace eventgan
