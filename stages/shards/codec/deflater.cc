#include "stages/shards/codec/deflater.h"

#include <libdeflate.h>

#include <new>
#include <stdexcept>

namespace eventgan {

struct Deflater::Compressor {
  explicit Compressor(int level) : library(libdeflate_alloc_compressor(level)) {
    if (library == nullptr) throw std::bad_alloc();
  }
  ~Compressor() { libdeflate_free_compressor(library); }
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;

  libdeflate_compressor* library;
};

Deflater::Deflater(int level) : compressor_(std::make_unique<Compressor>(level)) {}

Deflater::~Deflater() = default;

std::span<const std::byte> Deflater::deflate(std::span<const std::byte> bytes) {
  const std::size_t bound = libdeflate_zlib_compress_bound(compressor_->library, bytes.size());
  if (buffer_.size() < bound) buffer_.resize(bound);
  // Always the same room for the same input, however large the buffer has grown.
  const std::size_t size = libdeflate_zlib_compress(compressor_->library, bytes.data(),
                                                    bytes.size(), buffer_.data(), bound);
  if (size == 0) throw std::logic_error("libdeflate broke its own bound");
  return {buffer_.data(), size};
}

}  // namespace eventgan
