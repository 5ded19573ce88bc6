#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace eventgan {

/// Compresses into zlib's format with libdeflate, again and again with the same memory. What comes
/// out depends on the bytes and the level alone, not on what was compressed before. Thread safety:
/// one thread at a time.
class Deflater {
 public:
  /// `level` 1..9. Throws std::bad_alloc.
  explicit Deflater(int level);
  ~Deflater();
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;

  /// The compressed bytes; they stand until the next call.
  std::span<const std::byte> deflate(std::span<const std::byte> bytes);

 private:
  struct Compressor;
  std::unique_ptr<Compressor> compressor_;
  std::vector<std::byte> buffer_;  ///< as large as the worst case of the largest input so far
};

}  // namespace eventgan
