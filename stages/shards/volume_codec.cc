#include "stages/shards/volume_codec.h"

#include <libdeflate.h>

#include <cstdint>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/shards/fletcher32.h"
#include "stages/shards/quantization.h"

namespace eventgan {
namespace {

/// HDF5's filter shuffle: all first bytes of the numbers, then all second bytes, and so on. For
/// numbers of one byte it changes nothing, as in HDF5.
std::vector<std::byte> shuffle(std::vector<std::byte> bytes, std::size_t element_size) {
  if (element_size == 1) return bytes;
  std::vector<std::byte> shuffled(bytes.size());
  const std::size_t count = bytes.size() / element_size;
  for (std::size_t plane = 0; plane < element_size; ++plane) {
    std::byte* out = shuffled.data() + plane * count;
    const std::byte* in = bytes.data() + plane;
    for (std::size_t i = 0; i < count; ++i) out[i] = in[i * element_size];
  }
  return shuffled;
}

std::vector<std::byte> deflate(const std::vector<std::byte>& bytes, int level) {
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
      libdeflate_alloc_compressor(level), &libdeflate_free_compressor);
  if (!compressor) throw std::bad_alloc();
  std::vector<std::byte> out(libdeflate_zlib_compress_bound(compressor.get(), bytes.size()));
  const std::size_t size = libdeflate_zlib_compress(compressor.get(), bytes.data(), bytes.size(),
                                                    out.data(), out.size());
  if (size == 0) throw std::logic_error("libdeflate broke its own bound");
  out.resize(size);
  return out;
}

}  // namespace

VolumeCodec::VolumeCodec(StoredType type, int deflate_level)
    : type_(type), deflate_level_(deflate_level) {
  if (deflate_level < 0 || deflate_level > 9) {
    throw std::invalid_argument("expected a deflate level 0..9, got " +
                                std::to_string(deflate_level));
  }
}

EncodedVolume VolumeCodec::encode(std::span<const float> volume) const {
  QuantizedVolume quantized = quantize(volume, type_);
  EncodedVolume result;
  result.scale = quantized.scale;
  result.saturated = quantized.saturated;
  result.chunk = shuffle(std::move(quantized.bytes), stored_size(type_));
  if (deflate_level_ > 0) result.chunk = deflate(result.chunk, deflate_level_);
  append_fletcher32(result.chunk);
  return result;
}

}  // namespace eventgan
