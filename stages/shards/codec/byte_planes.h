#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace eventgan {

// HDF5's filter shuffle: all first bytes (the lowest, little endian) of a chunk's numbers, then all
// second bytes, and so on. Here some numbers of a chunk at a time: byte b of numbers[i] goes to
// planes[b * plane_size + i], plane_size = the number of numbers in the chunk. Thread safe.

void split_into_planes(std::span<const std::uint16_t> numbers, std::byte* planes,
                       std::size_t plane_size);

void split_into_planes(std::span<const std::uint32_t> numbers, std::byte* planes,
                       std::size_t plane_size);

}  // namespace eventgan
