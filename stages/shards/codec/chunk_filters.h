#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/shards/codec/run_deflate.h"

struct libdeflate_compressor;

namespace eventgan {

// HDF5's filter shuffle: all first bytes (the lowest, little endian) of a chunk's numbers, then all
// second bytes, and so on. Here some numbers of a chunk at a time: byte b of numbers[i] goes to
// planes[b * plane_size + i], plane_size = the number of numbers in the chunk. Thread safe.

void split_into_planes(std::span<const std::uint16_t> numbers, std::byte* planes,
                       std::size_t plane_size);

void split_into_planes(std::span<const std::uint32_t> numbers, std::byte* planes,
                       std::size_t plane_size);

/// The other way: numbers from the bytes at planes[b * plane_size + i].
void join_planes(const std::byte* planes, std::size_t plane_size, std::span<std::uint16_t> numbers);

void join_planes(const std::byte* planes, std::size_t plane_size, std::span<std::uint32_t> numbers);

/// Compresses into zlib's format, again and again with the same memory: at level 1 by runs of zeros
/// alone (run_deflate.h), above with libdeflate. What comes out depends on the bytes and the level
/// alone. Thread safety: one thread at a time.
class Deflater {
 public:
  /// `level` 1..9. Throws std::bad_alloc.
  explicit Deflater(int level);
  ~Deflater();
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;

  /// The compressed bytes; they are valid until the next call. At most 4 GiB, as a chunk of HDF5;
  /// throws std::length_error for more.
  std::span<const std::byte> deflate(std::span<const std::byte> bytes);

 private:
  struct FreeLibrary {
    void operator()(libdeflate_compressor* library) const;
  };
  std::unique_ptr<RunDeflater> runs_;  ///< at level 1
  std::unique_ptr<libdeflate_compressor, FreeLibrary> library_;
  std::unique_ptr<std::byte[]> room_;  ///< for the worst case of the largest input so far
  std::size_t room_size_ = 0;
};

/// The checksum of HDF5's filter fletcher32: Fletcher's sums modulo 65535 over big-endian 16-bit
/// words, an odd last byte taken as the high half of a word; the second sum in the high half of the
/// result. Thread safe.
std::uint32_t fletcher32(std::span<const std::byte> bytes);

/// Appends it as the filter does, in little endian.
void append_fletcher32(std::vector<std::byte>& bytes);

/// Whether `bytes` ends in the checksum of what is before it.
bool ends_in_fletcher32(std::span<const std::byte> bytes);

}  // namespace eventgan
