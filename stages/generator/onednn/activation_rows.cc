#include "stages/generator/onednn/activation_rows.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include "stages/base/processor_clones.h"
#include "stages/generator/weights.h"

namespace eventgan {
namespace {

[[gnu::always_inline]] inline void store(float value, float& stored) { stored = value; }

[[gnu::always_inline]] inline void store(float value, Bfloat16& stored) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t rounded = bits + 0x7fff + ((bits >> 16) & 1);
  const bool is_nan = (bits & 0x7fffffff) > 0x7f800000;
  stored.bits = static_cast<std::uint16_t>((is_nan ? bits | 0x400000 : rounded) >> 16);
}

[[gnu::always_inline]] inline void store(float value, std::uint8_t& stored) {
  // One step a line: nested, GCC 14 makes a masked loop of it that takes three times as long.
  const float positive = value > 0 ? value : 0.0f;
  const float clipped = std::min(positive, 255.0f);
  stored = static_cast<std::uint8_t>(static_cast<std::int32_t>(clipped + 0.5f));
}

template <class T>
[[gnu::always_inline]] inline void store_each(const float* values, std::size_t count, T* stored) {
  for (std::size_t i = 0; i < count; ++i) store(values[i], stored[i]);
}

[[gnu::always_inline]] inline void combine(const float* skip, const float* phase, std::size_t count,
                                           float* combined) {
  for (std::size_t i = 0; i < count; ++i) {
    const float sum = skip[i] + phase[i];
    combined[i] = sum > 0 ? sum : sum * kLeakySlope;
  }
}

/// The values of a row's pixel behind the phases' kernel: pixel x of the image is at
/// (x + 1) / 2.
[[gnu::always_inline]] inline const float* phase_of(const DecoderRow& row, std::ptrdiff_t i) {
  const std::ptrdiff_t x = i + row.column_phase;
  const std::ptrdiff_t phase = 2 * row.row_phase + x % 2;
  return row.phases + (((x + 1) / 2 - row.column_phase) * 4 + phase) * row.channels;
}

[[gnu::always_inline]] inline void combine_row(const DecoderRow& row, float* combined) {
  const std::size_t channels = row.channels;
  if (row.whole_row) {
    combine(row.skip, row.whole_row, row.width * channels, combined);
    return;
  }
  const std::ptrdiff_t from_phases = row.last_pixel ? row.width - 1 : row.width;
  for (std::ptrdiff_t x = 0; x < from_phases; ++x) {
    combine(row.skip + x * channels, phase_of(row, x), channels, combined + x * channels);
  }
  if (row.last_pixel) {
    const std::size_t last = from_phases * channels;
    combine(row.skip + last, row.last_pixel, channels, combined + last);
  }
}

/// Narrow types are stored from a whole row of float32: the few channels of a pixel fill no
/// register.
template <class T>
[[gnu::always_inline]] inline void combine_and_store(const DecoderRow& row, T* stored) {
  combine_row(row, row.skip);
  store_each(row.skip, static_cast<std::size_t>(row.width) * row.channels, stored);
}

/// How many are 255. Counted in bytes, lane by lane, as long as these cannot overflow.
EVENTGAN_CLONES
std::size_t count_largest(const std::uint8_t* activations, std::size_t count) {
  constexpr std::size_t kLanes = 64, kMostRows = 255;
  std::size_t largest = 0;
  while (count >= kLanes) {
    const std::size_t rows = std::min(count / kLanes, kMostRows);
    std::array<std::uint8_t, kLanes> lanes{};
    for (std::size_t row = 0; row < rows; ++row, activations += kLanes) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) lanes[lane] += activations[lane] == 255;
    }
    for (const std::uint8_t lane : lanes) largest += lane;
    count -= rows * kLanes;
  }
  for (std::size_t i = 0; i < count; ++i) largest += activations[i] == 255;
  return largest;
}

}  // namespace

void SaturationCount::add(const std::uint8_t* activations, std::size_t count) {
  stored += count;
  saturated += count_largest(activations, count);
}

EVENTGAN_CLONES
void store_activations(const float* values, std::size_t count, float* stored) {
  store_each(values, count, stored);
}

EVENTGAN_CLONES
void store_activations(const float* values, std::size_t count, Bfloat16* stored) {
  store_each(values, count, stored);
}

EVENTGAN_CLONES
void store_activations(const float* values, std::size_t count, std::uint8_t* stored) {
  store_each(values, count, stored);
}

EVENTGAN_CLONES
void combine_phases(const DecoderRow& row, float* stored) { combine_row(row, stored); }

EVENTGAN_CLONES
void combine_phases(const DecoderRow& row, Bfloat16* stored) { combine_and_store(row, stored); }

EVENTGAN_CLONES
void combine_phases(const DecoderRow& row, std::uint8_t* stored) { combine_and_store(row, stored); }

EVENTGAN_CLONES
bool rectify_into_planes(const float* pixels, std::size_t pixel_count, int channels, float* planes,
                         std::size_t plane_stride) {
  // In blocks that stay in the first-level cache, since pixels and planes are far apart.
  constexpr std::size_t kBlock = 64;
  std::uint32_t largest = 0;  // magnitude, as bits: in the numbers' order, NaN above infinity
  for (std::size_t begin = 0; begin < pixel_count; begin += kBlock) {
    const std::size_t end = std::min(begin + kBlock, pixel_count);
    for (std::size_t i = begin * channels; i < end * channels; ++i) {
      largest = std::max(largest, std::bit_cast<std::uint32_t>(pixels[i]) & 0x7fffffff);
    }
    for (int c = 0; c < channels; ++c) {
      float* plane = planes + c * plane_stride;
      for (std::size_t i = begin; i < end; ++i) {
        const float value = pixels[i * channels + c];
        plane[i] = value <= 0 ? 0.0f : value;
      }
    }
  }
  return largest < std::bit_cast<std::uint32_t>(std::numeric_limits<float>::infinity());
}

std::vector<DecoderStrip> decoder_strips(int height, int phase_rows) {
  std::vector<DecoderStrip> strips;
  const int all_phase_rows = height / 2 + 1;
  for (int first = 0; first < all_phase_rows; first += phase_rows) {
    const int count = std::min(phase_rows, all_phase_rows - first);
    const int begin = std::max(2 * first - 1, 0);
    const int end = std::min(2 * (first + count) - 1, height);
    strips.push_back({begin, end - begin, first, count});
  }
  return strips;
}

}  // namespace eventgan
