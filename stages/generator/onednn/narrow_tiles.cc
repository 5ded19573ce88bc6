#include "stages/generator/onednn/narrow_tiles.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace eventgan {
namespace {

constexpr int kChannels = 8;
constexpr int kTileRows = 16;
constexpr int kTileBytes = 64;  ///< of a row
constexpr int kTileValues = kTileRows * kTileBytes / sizeof(Bfloat16);
constexpr int kSums = 2 * kChannels;  ///< of a pair
constexpr int kBlockSums = kTileRows * kSums;
/// Values from a pair's inputs to the next one's: two pixels, but one of the small image, which
/// has twice the channels.
constexpr int kStep = 2 * kChannels;

/// weight(value, sum) for a tile of weights: values in pairs, [value / 2, sum, value % 2].
template <class Weight>
void append_tile(std::vector<Bfloat16>& tiles, Weight&& weight) {
  std::vector<float> values(kTileValues);
  for (int i = 0; i < kTileValues; ++i) {
    values[i] = weight(i / (2 * kSums) * 2 + i % 2, i / 2 % kSums);
  }
  tiles.resize(tiles.size() + kTileValues);
  store_activations(values.data(), values.size(), tiles.data() + tiles.size() - kTileValues);
}

#if defined(__x86_64__)
#define EVENTGAN_AMX __attribute__((target("amx-tile,amx-bf16")))

/// What LDTILECFG reads: tiles of 16 rows of 64 bytes.
struct alignas(64) TileShapes {
  std::uint8_t palette = 1;
  std::uint8_t start_row = 0;
  std::uint8_t reserved[14] = {};
  std::uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
  std::uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
};
constexpr TileShapes kShapes;

/// sums[block] (+)= inputs[row][block] x weights[row], summed over rows.
template <int kRows>
EVENTGAN_AMX void multiply(const Bfloat16* const (&inputs)[kRows], const Bfloat16* weights,
                           bool add, float* sums, std::ptrdiff_t blocks) {
  // GCC does not know that tiles are loaded from memory.
  std::atomic_signal_fence(std::memory_order_seq_cst);
  constexpr std::ptrdiff_t kStride = kStep * sizeof(Bfloat16);
  _tile_loadd(4, weights, kTileBytes);
  _tile_loadd(5, weights + kTileValues, kTileBytes);
  if constexpr (kRows == 3) _tile_loadd(6, weights + 2 * kTileValues, kTileBytes);
  for (std::ptrdiff_t block = 0; block < blocks; ++block, sums += kBlockSums) {
    const std::ptrdiff_t from = block * kTileRows * kStep;
    if (add) {
      _tile_loadd(0, sums, kTileBytes);
    } else {
      _tile_zero(0);
    }
    _tile_loadd(1, inputs[0] + from, kStride);
    _tile_dpbf16ps(0, 1, 4);
    _tile_loadd(2, inputs[1] + from, kStride);
    _tile_dpbf16ps(0, 2, 5);
    if constexpr (kRows == 3) {
      _tile_loadd(3, inputs[2] + from, kStride);
      _tile_dpbf16ps(0, 3, 6);
    }
    _tile_stored(0, sums, kTileBytes);
  }
}

/// kShapes, until this is destroyed; then what was set before.
class TileSettings {
 public:
  EVENTGAN_AMX TileSettings() {
    _tile_storeconfig(before_);
    _tile_loadconfig(&kShapes);
  }
  EVENTGAN_AMX ~TileSettings() { _tile_loadconfig(before_); }
  TileSettings(const TileSettings&) = delete;
  TileSettings& operator=(const TileSettings&) = delete;

 private:
  alignas(64) std::byte before_[64];
};
#else
template <int kRows>
void multiply(const Bfloat16* const (&)[kRows], const Bfloat16*, bool, float*, std::ptrdiff_t) {
  throw std::logic_error("expected a processor with AMX");
}
struct TileSettings {};
#endif

}  // namespace

NarrowTiles::NarrowTiles(const LayerNumbers& skip, const LayerNumbers& phases, ImageSize size)
    : size_(size), blocks_(size.width / (2 * kTileRows) + 1) {
  for (int row = 0; row < 3; ++row) {
    append_tile(skip_, [&](int value, int sum) {
      // Of the pixels -1 to 2 about a pair's 0 and 1.
      const int column = value / kChannels - sum / kChannels;
      if (column < 0 || column > 2) return 0.0f;
      const int o = sum % kChannels, c = value % kChannels;
      return skip.weight[((o * kChannels + c) * 3 + row) * 3 + column];
    });
  }
  for (int row_and_phase = 0; row_and_phase < 4; ++row_and_phase) {
    append_tile(phases_, [&](int value, int sum) {
      // A pair's first pixel is of column phase 1, its second one of phase 0 of the next.
      const int phase = row_and_phase / 2 * 2 + 1 - sum / kChannels;
      const int o = phase * kChannels + sum % kChannels;
      const int c = value % (2 * kChannels), column = value / (2 * kChannels);
      return phases.weight[((o * 2 * kChannels + c) * 2 + row_and_phase % 2) * 2 + column];
    });
  }
}

std::size_t NarrowTiles::buffer_bytes() const {
  return sums_values() * sizeof(float) +
         (3 * skip_row_values() + 2 * small_row_values()) * sizeof(Bfloat16);
}

const float* NarrowTiles::sum_row(const Bfloat16* small, const Bfloat16* skip,
                                  const DecoderRow& edges, int y, std::byte* buffer) const {
  auto* const sums = reinterpret_cast<float*>(buffer);
  auto* const strips = reinterpret_cast<Bfloat16*>(sums + sums_values());
  if (y == 0) std::memset(buffer, 0, buffer_bytes());
  // Rows of the inputs between zeros: row -1 is zero from the start, the one behind the last is
  // made so.
  const auto skip_row = [&](int row) { return strips + (row + 3) % 3 * skip_row_values(); };
  const auto small_row = [&](int row) {
    return strips + 3 * skip_row_values() + (row + 2) % 2 * small_row_values();
  };
  const auto read = [](const Bfloat16* from, ImageSize size, int channels, int row, int before,
                       Bfloat16* to) {
    const std::size_t values = static_cast<std::size_t>(size.width) * channels;
    to += before * channels;
    if (row < size.height) {
      std::memcpy(to, from + row * values, values * sizeof(Bfloat16));
    } else {
      std::fill_n(to, values, Bfloat16{});
    }
  };
  const int p = (y + 1) / 2;
  if (y == 0) read(skip, size_, kChannels, 0, 2, skip_row(0));
  read(skip, size_, kChannels, y + 1, 2, skip_row(y + 1));
  if (y == 0 || y % 2 == 1) read(small, half_size(size_), 2 * kChannels, p, 1, small_row(p));

  const TileSettings settings;
  if (edges.whole_row) {
    std::memcpy(sums + kChannels, edges.whole_row, size_.width * kChannels * sizeof(float));
  } else {
    multiply({small_row(p - 1), small_row(p)}, phases_.data() + y % 2 * 2 * kTileValues, false,
             sums, blocks_);
    if (edges.last_pixel) {
      std::memcpy(sums + size_.width * kChannels, edges.last_pixel, kChannels * sizeof(float));
    }
  }
  multiply({skip_row(y - 1), skip_row(y), skip_row(y + 1)}, skip_.data(), true, sums, blocks_);
  return sums;
}

}  // namespace eventgan
