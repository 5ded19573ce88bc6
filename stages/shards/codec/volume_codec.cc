#include "stages/shards/codec/volume_codec.h"

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/shards/codec/chunk_filters.h"
#include "stages/shards/codec/quantization.h"

namespace eventgan {
namespace {

constexpr std::size_t kChecksumBytes = 4;

float largest_sound_value(std::span<const float> values) {
  float largest = 0;
  bool sound = true;
  for (const float value : values) {
    sound &= value >= 0;  // false for NaN
    largest = std::max(largest, value);
  }
  if (!sound || !std::isfinite(largest)) {
    throw std::invalid_argument("expected finite values >= 0 in a volume to store, got others");
  }
  return largest;
}

void check(const VolumeWindow& window, std::size_t value_count) {
  const ImageSize whole = window.whole.size;
  if (window.x < 0 || window.y < 0 || window.x + window.content.width > whole.width ||
      window.y + window.content.height > whole.height) {
    throw std::invalid_argument("expected a window inside of the volume, got one across its edge");
  }
  if (value_count != window.value_count()) {
    throw std::invalid_argument("expected " + std::to_string(window.value_count()) +
                                " values, got " + std::to_string(value_count));
  }
}

/// Calls run(first value, its place in the whole volume, count) for the longest stretches of values
/// that lie next to each other in the whole volume too.
template <class Run>
void for_each_run(const VolumeWindow& window, Run run) {
  const ImageSize whole = window.whole.size;
  const ImageSize content = window.content;
  const bool whole_rows = content.width == whole.width;
  const int runs = whole_rows ? 1 : content.height;  // in each channel
  const std::size_t count = content.pixel_count() / static_cast<std::size_t>(std::max(runs, 1));
  std::size_t value = 0;
  for (int channel = 0; channel < window.whole.channels(); ++channel) {
    const std::size_t corner = static_cast<std::size_t>(channel) * whole.pixel_count() +
                               static_cast<std::size_t>(window.y) * whole.width + window.x;
    for (int row = 0; row < runs; ++row, value += count) {
      run(value, corner + static_cast<std::size_t>(row) * whole.width, count);
    }
  }
}

}  // namespace

/// What one call works with, kept for the next.
class VolumeCodec::Workspaces {
 public:
  struct Workspace {
    explicit Workspace(int level) : deflater(level) {}
    std::vector<std::byte> planes;
    Deflater deflater;
  };

  std::unique_ptr<Workspace> take(int level) {
    {
      const std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        std::unique_ptr<Workspace> workspace = std::move(idle_.back());
        idle_.pop_back();
        return workspace;
      }
    }
    return std::make_unique<Workspace>(level);
  }

  void give_back(std::unique_ptr<Workspace> workspace) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(workspace));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Workspace>> idle_;
};

VolumeCodec::VolumeCodec(StoredType type, int deflate_level)
    : type_(type), deflate_level_(deflate_level), workspaces_(std::make_unique<Workspaces>()) {
  if (deflate_level < 0 || deflate_level > 9) {
    throw std::invalid_argument("expected a deflate level 0..9, got " +
                                std::to_string(deflate_level));
  }
}

VolumeCodec::~VolumeCodec() = default;

template <class WritePlanes>
std::vector<std::byte> VolumeCodec::chunk(std::size_t count, WritePlanes write_planes) const {
  const std::size_t size = count * stored_size(type_);
  std::vector<std::byte> chunk;
  if (deflate_level_ == 0) {
    chunk.reserve(size + kChecksumBytes);
    chunk.resize(size);
    write_planes(std::span(chunk));
  } else {
    auto workspace = workspaces_->take(deflate_level_);
    workspace->planes.resize(size);
    write_planes(std::span(workspace->planes));
    const std::span<const std::byte> deflated = workspace->deflater.deflate(workspace->planes);
    chunk.reserve(deflated.size() + kChecksumBytes);
    chunk.assign(deflated.begin(), deflated.end());
    workspaces_->give_back(std::move(workspace));
  }
  append_fletcher32(chunk);
  return chunk;
}

EncodedVolume VolumeCodec::encode(std::span<const float> volume) const {
  const Quantization how = quantization(type_, largest_sound_value(volume));
  const auto write_planes = [&](std::span<std::byte> planes) {
    quantize(volume, how, planes.data(), volume.size());
  };
  return {chunk(volume.size(), write_planes), how.scale, how.saturated, how.vanished};
}

EncodedVolume VolumeCodec::encode(std::span<const float> values, const VolumeWindow& window,
                                  float largest) const {
  check(window, values.size());
  const std::size_t count = window.whole.value_count();
  const Quantization how = quantization(type_, largest);
  const auto write_planes = [&](std::span<std::byte> planes) {
    // Zero is the code of no events in every type.
    if (values.size() != count) std::fill(planes.begin(), planes.end(), std::byte{0});
    for_each_run(window, [&](std::size_t value, std::size_t place, std::size_t run) {
      quantize(values.subspan(value, run), how, planes.data() + place, count);
    });
  };
  return {chunk(count, write_planes), how.scale, how.saturated, how.vanished};
}

namespace {

/// The planes of a chunk; none if it is not sound.
std::unique_ptr<std::byte[]> planes_of(std::span<const std::byte> chunk, int deflate_level,
                                       std::size_t size_bytes) {
  if (!ends_in_fletcher32(chunk)) return nullptr;
  const std::span<const std::byte> stored = chunk.first(chunk.size() - kChecksumBytes);
  auto planes = std::make_unique_for_overwrite<std::byte[]>(size_bytes);
  if (deflate_level == 0) {
    if (stored.size() != size_bytes) return nullptr;
    std::ranges::copy(stored, planes.get());
    return planes;
  }
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> inflater(
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  if (!inflater) throw std::bad_alloc();
  // Without room for its answer it takes nothing but the expected size.
  const libdeflate_result result = libdeflate_zlib_decompress(
      inflater.get(), stored.data(), stored.size(), planes.get(), size_bytes, nullptr);
  return result == LIBDEFLATE_SUCCESS ? std::move(planes) : nullptr;
}

/// Calls take(first, bytes) for the numbers of `count` values in order, from value `first` on.
template <class Number, class Take>
void join_blocks(const std::byte* planes, std::size_t count, Take take) {
  std::array<Number, 1024> numbers;  // which stay in the first-level cache
  for (std::size_t i = 0; i < count; i += numbers.size()) {
    const std::span block(numbers.data(), std::min(numbers.size(), count - i));
    join_planes(planes + i, count, block);
    take(i, std::as_bytes(block));
  }
}

template <class Take>
void join_blocks(const std::byte* planes, StoredType type, std::size_t count, Take take) {
  switch (stored_size(type)) {
    case 1:
      return take(std::size_t{0}, std::span(planes, count));
    case 2:
      return join_blocks<std::uint16_t>(planes, count, take);
    default:
      return join_blocks<std::uint32_t>(planes, count, take);
  }
}

}  // namespace

std::optional<std::vector<std::byte>> decode_chunk(std::span<const std::byte> chunk,
                                                   StoredType type, int deflate_level,
                                                   std::size_t size_bytes) {
  const auto planes = planes_of(chunk, deflate_level, size_bytes);
  if (!planes) return std::nullopt;
  std::vector<std::byte> numbers(size_bytes);
  const std::size_t width = stored_size(type);
  join_blocks(planes.get(), type, size_bytes / width,
              [&](std::size_t first, std::span<const std::byte> block) {
                std::ranges::copy(block, numbers.data() + first * width);
              });
  return numbers;
}

bool decode_volume(std::span<const std::byte> chunk, StoredType type, int deflate_level,
                   float scale, std::span<float> volume) {
  const std::size_t width = stored_size(type);
  const auto planes = planes_of(chunk, deflate_level, volume.size() * width);
  if (!planes) return false;
  join_blocks(planes.get(), type, volume.size(),
              [&](std::size_t first, std::span<const std::byte> block) {
                dequantize(block, type, scale, volume.subspan(first, block.size() / width));
              });
  return true;
}

}  // namespace eventgan
