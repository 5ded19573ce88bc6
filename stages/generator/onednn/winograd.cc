#include "stages/generator/onednn/winograd.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>

#include "stages/generator/onednn/detail/onednn_versions.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/weights.h"

#if defined(__x86_64__)
#define EVENTGAN_AVX2 __attribute__((target("avx2,fma")))
#else
#define EVENTGAN_AVX2
#endif
#define EVENTGAN_EIGHT_INLINE EVENTGAN_AVX2 __attribute__((always_inline)) inline

namespace eventgan {
namespace {

constexpr int kEight = 8;
using Eight = float __attribute__((vector_size(kEight * sizeof(float)), may_alias));
using EightBits = std::uint32_t __attribute__((vector_size(kEight * sizeof(float))));
/// The same anywhere in memory.
using EightInMemory =
    float __attribute__((vector_size(kEight * sizeof(float)), aligned(alignof(float)), may_alias));

EVENTGAN_EIGHT_INLINE Eight eight(const float* values) {
  return *reinterpret_cast<const Eight*>(values);
}
EVENTGAN_EIGHT_INLINE void keep(Eight lanes, float* values) {
  *reinterpret_cast<Eight*>(values) = lanes;
}

// F(2, 3) of a row: outputs 0 and 1 of inputs d and kernel g are t0 + t1 + t2 and t1 - t2 - t3 of
//   t = (d0 - d2) g0, (d1 + d2) (g0 + g1 + g2) / 2, (d2 - d1) (g0 - g1 + g2) / 2, (d1 - d3) g2.
// A doubled row has d = a, a, b, b, and its outputs a (g0 + g1) + b g2 and a g0 + b (g1 + g2) are
// those of
//   t1 = a (g0 + g1 / 2) + b (g2 + g1 / 2), t2 = (a - b) g1 / 2,
// three products where t has four. If the image ends before d3, the last output's b g2 is none of
// it: t3 = b g2. Of tiles, rows and columns each are summed so: slot 4 i + j has t_i of rows and
// t_j of columns.
constexpr int kSide = 4, kSlots = kSide * kSide;
/// Of the doubled image: what is multiplied in a slot's row or column (a and b; a - b; b).
constexpr std::array<int, kSide> kDoubledTerms = {0, 2, 1, 1};
constexpr int kTerms = 4;
constexpr std::array<int, kTerms> kSlotOfTerm = {1, 1, 2, 3};
constexpr std::array<int, kTerms> kTermInSlot = {0, 1, 0, 0};

/// Input channels of a slot.
int slot_depth(int slot, int in, int small) {
  return in + small * kDoubledTerms[slot / kSide] * kDoubledTerms[slot % kSide];
}
int depth_before(int slot, int in, int small) {
  int depth = 0;
  for (int before = 0; before < slot; ++before) depth += slot_depth(before, in, small);
  return depth;
}

/// What a slot multiplies the kernel's rows (columns) with.
constexpr double kPlainKernel[kSide][3] = {{1, 0, 0}, {0.5, 0.5, 0.5}, {0.5, -0.5, 0.5}, {0, 0, 1}};
constexpr double kDoubledKernel[kTerms][3] = {{1, 0.5, 0}, {0, 0.5, 1}, {0, 0.5, 0}, {0, 0, 1}};

float transformed(const float* kernel, const double (&rows)[3], const double (&columns)[3]) {
  double sum = 0;
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) sum += rows[y] * columns[x] * kernel[3 * y + x];
  }
  return static_cast<float>(sum);
}

/// Sixteen sums' registers, but those of inputs and weights, hold 12: of 6 tiles with 16 outputs,
/// or of 12 with 8.
int vectors_of(int out) { return out % (2 * kEight) == 0 ? 2 : 1; }
int group_of(int out) { return 12 / vectors_of(out); }

/// Tiles whose inputs and sums stay in a second-level cache, beside the weights of a slot.
int tiles_at_once(int bytes_of_tile) {
  constexpr int kBytesOfTiles = 1 << 17, kWholeGroups = 12;
  return std::clamp(kBytesOfTiles / bytes_of_tile / kWholeGroups, 1, 8) * kWholeGroups;
}

}  // namespace

bool winograd_fits(int base_channels, Precision precision) {
#if defined(__x86_64__)
  // Without AVX-512 there is no bfloat16.
  return base_channels % kEight == 0 && precision == Precision::kFloat32 &&
         processor_has(dnnl::cpu_isa::avx2) && __builtin_cpu_supports("fma") &&
         !onednn_support(Precision::kBfloat16).able;
#else
  static_cast<void>(base_channels), static_cast<void>(precision);
  return false;
#endif
}

struct WinogradConvolution::Block {
  int first = 0;  ///< tile, row by row
  int count = 0;
  int columns = 0;           ///< of tiles
  bool last_row = false;     ///< some tile's doubled rows end before its d3
  bool last_column = false;  ///< and columns
  float* values = nullptr;   ///< [slot, tile / group's, in / 8, tile % group's, in % 8]
  float* sums = nullptr;     ///< [slot, tile / group's, out / vector's, tile % group's, out % it]
};

WinogradConvolution::WinogradConvolution(const LayerNumbers& plain, const LayerNumbers* doubled,
                                         float slope)
    : in_(plain.in_channels),
      small_(doubled ? doubled->in_channels : 0),
      out_(plain.out_channels),
      slope_(slope),
      tiles_at_once_(tiles_at_once(static_cast<int>(sizeof(float)) *
                                   (depth_before(kSlots, in_, small_) + kSlots * out_))),
      weights_(static_cast<std::size_t>(depth_before(kSlots, in_, small_)) * out_ / kEight),
      bias_(plain.bias) {
  bias_.resize(out_);
  const int width = vectors_of(out_) * kEight;
  float* slot_weights = weights_.front().values;
  for (int slot = 0; slot < kSlots; ++slot) {
    const int rows = slot / kSide, columns = slot % kSide;
    const int depth = slot_depth(slot, in_, small_);
    for (int o = 0; o < out_; ++o) {
      const auto at = [&](int i) -> float& {
        return slot_weights[(static_cast<std::size_t>(o / width) * depth + i) * width + o % width];
      };
      for (int i = 0; i < in_; ++i) {
        at(i) = transformed(&plain.weight[(static_cast<std::size_t>(o) * in_ + i) * 9],
                            kPlainKernel[rows], kPlainKernel[columns]);
      }
      for (int term = 0; term < kTerms * kTerms && small_ > 0; ++term) {
        const int row = term / kTerms, column = term % kTerms;
        if (kSlotOfTerm[row] != rows || kSlotOfTerm[column] != columns) continue;
        const int place = kTermInSlot[row] * kDoubledTerms[columns] + kTermInSlot[column];
        for (int i = 0; i < small_; ++i) {
          at(in_ + place * small_ + i) =
              transformed(&doubled->weight[(static_cast<std::size_t>(o) * small_ + i) * 9],
                          kDoubledKernel[row], kDoubledKernel[column]);
        }
      }
    }
    slot_weights += static_cast<std::size_t>(depth) * out_;
  }
}

std::size_t WinogradConvolution::buffer_bytes() const {
  return sizeof(float) * tiles_at_once_ * (depth_before(kSlots, in_, small_) + kSlots * out_);
}

namespace {

/// sums[tile, out] of a group's values [in / 8, tile, in % 8] and weights [in, out].
template <int kTiles, int kVectors>
EVENTGAN_EIGHT_INLINE void multiply(const float* values, const float* weights, int eights,
                                    float* sums) {
  Eight sum[kTiles][kVectors] = {};
  for (int i = 0; i < eights; ++i, values += kTiles * kEight) {
#pragma GCC unroll 8
    for (int channel = 0; channel < kEight; ++channel, weights += kVectors * kEight) {
      Eight weight[kVectors];
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) weight[v] = eight(weights + v * kEight);
#pragma GCC unroll 12
      for (int tile = 0; tile < kTiles; ++tile) {
#pragma GCC unroll 2
        for (int v = 0; v < kVectors; ++v) {
          sum[tile][v] += weight[v] * values[tile * kEight + channel];
        }
      }
    }
  }
#pragma GCC unroll 12
  for (int tile = 0; tile < kTiles; ++tile) {
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) keep(sum[tile][v], sums + (tile * kVectors + v) * kEight);
  }
}

}  // namespace

template <int kTiles, int kVectors>
EVENTGAN_AVX2 void WinogradConvolution::multiply_slots(const Block& block) const {
  const int groups = (block.count + kTiles - 1) / kTiles;
  const float* values = block.values;
  const float* weights = weights_.front().values;
  float* sums = block.sums;
  for (int slot = 0; slot < kSlots; ++slot) {
    const int depth = slot_depth(slot, in_, small_);
    const bool none_doubled = (slot / kSide == kSide - 1 && !block.last_row) ||
                              (slot % kSide == kSide - 1 && !block.last_column);
    const int eights = (none_doubled ? in_ : depth) / kEight;
    for (int panel = 0; panel < out_ / (kVectors * kEight); ++panel) {
      for (int group = 0; group < groups; ++group) {
        multiply<kTiles, kVectors>(
            values + group * kTiles * depth, weights, eights,
            sums + group * kTiles * out_ + panel * kTiles * kVectors * kEight);
      }
      weights += depth * kVectors * kEight;
    }
    values += tiles_at_once_ * depth;
    sums += tiles_at_once_ * out_;
  }
}

namespace {

/// A row (column) of slots from what it has of the four inputs.
template <int kSlot, class At>
EVENTGAN_EIGHT_INLINE Eight slot_input(At&& at) {
  if constexpr (kSlot == 0) return at(0) - at(2);
  if constexpr (kSlot == 1) return at(1) + at(2);
  if constexpr (kSlot == 2) return at(2) - at(1);
  return at(1) - at(3);
}

/// pixel(y, x): the tile's four by four.
template <int kRow, class Pixel>
EVENTGAN_EIGHT_INLINE void slot_row(Pixel&& pixel, const std::array<float*, kSlots>& slots,
                                    std::ptrdiff_t to) {
  Eight row[kSide];
#pragma GCC unroll 4
  for (int x = 0; x < kSide; ++x) {
    row[x] = slot_input<kRow>([&](int y) EVENTGAN_AVX2 { return pixel(y, x); });
  }
  const auto at = [&](int x) EVENTGAN_AVX2 { return row[x]; };
  keep(slot_input<0>(at), slots[kRow * kSide] + to);
  keep(slot_input<1>(at), slots[kRow * kSide + 1] + to);
  keep(slot_input<2>(at), slots[kRow * kSide + 2] + to);
  keep(slot_input<3>(at), slots[kRow * kSide + 3] + to);
}

}  // namespace

EVENTGAN_AVX2
void WinogradConvolution::read_input(const Images& images, const Block& block) const {
  const int group = group_of(out_);
  const auto [height, width] = images.size;
  for (int i = 0; i < block.count; ++i) {
    const int tile = block.first + i;
    const int top = 2 * (tile / block.columns) - 2, left = 2 * (tile % block.columns) - 2;
    std::array<float*, kSlots> slots;
    float* values = block.values;
    for (int slot = 0; slot < kSlots; ++slot) {
      const int depth = slot_depth(slot, in_, small_);
      slots[slot] = values + i / group * group * depth + i % group * kEight;
      values += tiles_at_once_ * depth;
    }
    const auto fill = [&](auto&& pixel) EVENTGAN_AVX2 {
      for (int channel = 0; channel < in_; channel += kEight) {
        const auto at = [&](int y, int x) EVENTGAN_AVX2 { return pixel(y, x, channel); };
        slot_row<0>(at, slots, channel * group);
        slot_row<1>(at, slots, channel * group);
        slot_row<2>(at, slots, channel * group);
        slot_row<3>(at, slots, channel * group);
      }
    };
    const std::ptrdiff_t row_values = static_cast<std::ptrdiff_t>(width) * in_;
    if (top >= 0 && left >= 0 && top + kSide <= height && left + kSide <= width) {
      const float* corner = images.input + top * row_values + left * in_;
      fill([&](int y, int x, int channel)
               EVENTGAN_AVX2 { return eight(corner + y * row_values + x * in_ + channel); });
    } else {
      fill([&](int y, int x, int channel) EVENTGAN_AVX2 {
        const bool outside = top + y < 0 || left + x < 0 || top + y >= height || left + x >= width;
        if (outside) return Eight{};
        return eight(images.input + (top + y) * row_values + (left + x) * in_ + channel);
      });
    }
  }
}

EVENTGAN_AVX2
void WinogradConvolution::read_small(const Images& images, const Block& block) const {
  const int group = group_of(out_);
  const ImageSize size = half_size(images.size);
  for (int i = 0; i < block.count; ++i) {
    const int tile = block.first + i;
    const int row = tile / block.columns, column = tile % block.columns;
    // Of this tile b, and d3 is none.
    const bool last_row = images.size.height % 2 == 1 && row == size.height - 1;
    const bool last_column = images.size.width % 2 == 1 && column == size.width - 1;
    std::array<float*, kSlots> slots;
    float* values = block.values;
    for (int slot = 0; slot < kSlots; ++slot) {
      const int depth = slot_depth(slot, in_, small_);
      slots[slot] = values + i / group * group * depth + (in_ * group + i % group * kEight);
      values += tiles_at_once_ * depth;
    }
    const auto pixel = [&](int y, int x, int channel) EVENTGAN_AVX2 {
      y += row - 1, x += column - 1;
      if (y < 0 || x < 0 || y >= size.height || x >= size.width) return Eight{};
      return eight(images.small + (static_cast<std::ptrdiff_t>(y) * size.width + x) * small_ +
                   channel);
    };
    for (int channel = 0; channel < small_; channel += kEight) {
      Eight rows[kTerms][2];
#pragma GCC unroll 2
      for (int x = 0; x < 2; ++x) {
        rows[0][x] = pixel(0, x, channel);
        rows[1][x] = pixel(1, x, channel);
        rows[2][x] = rows[0][x] - rows[1][x];
        rows[3][x] = last_row ? rows[1][x] : Eight{};
      }
#pragma GCC unroll 4
      for (int y = 0; y < kTerms; ++y) {
        if (y == kTerms - 1 && !block.last_row) break;
        const Eight terms[kTerms] = {rows[y][0], rows[y][1], rows[y][0] - rows[y][1],
                                     last_column ? rows[y][1] : Eight{}};
#pragma GCC unroll 4
        for (int x = 0; x < kTerms; ++x) {
          if (x == kTerms - 1 && !block.last_column) break;
          const int place = kTermInSlot[y] * kDoubledTerms[kSlotOfTerm[x]] + kTermInSlot[x];
          keep(terms[x],
               slots[kSlotOfTerm[y] * kSide + kSlotOfTerm[x]] + (place * small_ + channel) * group);
        }
      }
    }
  }
}

EVENTGAN_AVX2
void WinogradConvolution::write_output(const Images& images, const Block& block, float* output,
                                       int output_row, bool add) const {
  const int group = group_of(out_), panel = vectors_of(out_) * kEight;
  const auto [height, width] = images.size;
  const std::ptrdiff_t slot_sums = static_cast<std::ptrdiff_t>(tiles_at_once_) * out_;
  for (int i = 0; i < block.count; ++i) {
    const int tile = block.first + i;
    const int top = 2 * (tile / block.columns) - 1, left = 2 * (tile % block.columns) - 1;
    for (int channel = 0; channel < out_; channel += kEight) {
      const float* sums = block.sums + i / group * group * out_ + channel / panel * group * panel +
                          i % group * panel + channel % panel;
      Eight rows[2][kSide];
#pragma GCC unroll 4
      for (int x = 0; x < kSide; ++x, sums += slot_sums) {
        const Eight middle = eight(sums + 4 * slot_sums), other = eight(sums + 8 * slot_sums);
        rows[0][x] = eight(sums) + middle + other;
        rows[1][x] = middle - other - eight(sums + 12 * slot_sums);
      }
#pragma GCC unroll 2
      for (int y = 0; y < 2; ++y) {
        if (top + y < 0 || top + y >= height) continue;
        const Eight pixels[2] = {rows[y][0] + rows[y][1] + rows[y][2],
                                 rows[y][1] - rows[y][2] - rows[y][3]};
#pragma GCC unroll 2
        for (int x = 0; x < 2; ++x) {
          if (left + x < 0 || left + x >= width) continue;
          float* to =
              output +
              (static_cast<std::ptrdiff_t>(top + y - output_row) * width + left + x) * out_ +
              channel;
          Eight sum = pixels[x] + eight(bias_.data() + channel);
          if (add) sum += eight(to);
          keep(sum > 0 ? sum : sum * slope_, to);
        }
      }
    }
  }
}

void WinogradConvolution::run(const Images& images, int first, int end, float* output,
                              int output_row, bool add, std::byte* buffer) const {
  Block block;
  block.columns = images.size.width / 2 + 1;
  block.values = reinterpret_cast<float*>(buffer);
  block.sums = block.values + tiles_at_once_ * depth_before(kSlots, in_, small_);
  const int last = end * block.columns;
  for (block.first = first * block.columns; block.first < last; block.first += block.count) {
    block.count = std::min(tiles_at_once_, last - block.first);
    if (small_ > 0) {
      const int last_tile = block.first + block.count - 1;
      block.last_row =
          images.size.height % 2 == 1 && last_tile / block.columns == tile_rows(images.size) - 1;
      block.last_column = images.size.width % 2 == 1 &&
                          (block.first % block.columns + block.count >= block.columns);
    }
    read_input(images, block);
    if (small_ > 0) read_small(images, block);
    if (vectors_of(out_) == 2) {
      multiply_slots<6, 2>(block);
    } else {
      multiply_slots<12, 1>(block);
    }
    write_output(images, block, output, output_row, add);
  }
}

namespace {

constexpr int kHeadPixels = 12;

/// From a row of a plane to the next: a zero before its first pixel and one behind its last, and
/// what is read of pixels that nobody needs.
std::ptrdiff_t head_pitch(int width) { return width + 2 + kHeadPixels; }

}  // namespace

HeadConvolution::HeadConvolution(const LayerNumbers& head)
    : in_(head.in_channels),
      out_(head.out_channels),
      weights_(static_cast<std::size_t>(out_) * in_ * 9 / kEight),
      bias_(out_ / kEight) {
  for (int o = 0; o < out_; ++o) {
    if (!head.bias.empty()) bias_[o / kEight].values[o % kEight] = head.bias[o];
    for (int i = 0; i < in_; ++i) {
      for (int tap = 0; tap < 9; ++tap) {
        weights_[((o / kEight * 3 + tap / 3) * in_ + i) * 3 + tap % 3].values[o % kEight] =
            head.weight[(static_cast<std::size_t>(o) * in_ + i) * 9 + tap];
      }
    }
  }
}

std::size_t HeadConvolution::buffer_bytes(ImageSize size) const {
  return sizeof(float) * 3 * in_ * head_pitch(size.width);
}

EVENTGAN_AVX2
void HeadConvolution::run(const float* inputs, ImageSize size, float* output,
                          std::byte* buffer) const {
  auto* const rows = reinterpret_cast<float*>(buffer);
  std::memset(buffer, 0, buffer_bytes(size));
  const std::ptrdiff_t pitch = head_pitch(size.width);
  for (int y = 0; y < size.height; ++y) {
    for (int row = y == 0 ? 0 : y + 1; row < std::min(y + 2, size.height); ++row) {
      for (int plane = 0; plane < in_; ++plane) {
        std::memcpy(rows + (row % 3 * in_ + plane) * pitch + 1,
                    inputs + (static_cast<std::ptrdiff_t>(plane) * size.height + row) * size.width,
                    size.width * sizeof(float));
      }
    }
    for (int x = 0; x < size.width; x += kHeadPixels) {
      const int pixels = std::min(kHeadPixels, size.width - x);
      for (int eights = 0; eights < out_ / kEight; ++eights) {
        Eight sums[kHeadPixels];
#pragma GCC unroll 12
        for (Eight& sum : sums) sum = eight(bias_[eights].values);
        for (int row = std::max(y - 1, 0); row < std::min(y + 2, size.height); ++row) {
          const float* plane = rows + row % 3 * in_ * pitch + x;
          const EightWeights* weights = &weights_[(eights * 3 + row - y + 1) * in_ * 3];
          for (int i = 0; i < in_; ++i, plane += pitch) {
#pragma GCC unroll 3
            for (int column = 0; column < 3; ++column, ++weights) {
              const Eight weight = eight(weights->values);
#pragma GCC unroll 12
              for (int p = 0; p < kHeadPixels; ++p) sums[p] += weight * plane[column + p];
            }
          }
        }
        float* to =
            output + (static_cast<std::ptrdiff_t>(y) * size.width + x) * out_ + eights * kEight;
#pragma GCC unroll 12
        for (int p = 0; p < kHeadPixels; ++p) {
          if (p < pixels) keep(sums[p] > 0 ? sums[p] : sums[p] * kLeakySlope, to + p * out_);
        }
      }
    }
  }
}

PlanePrediction::PlanePrediction(const LayerNumbers& pred)
    : in_(pred.in_channels), out_(pred.out_channels), weights_(pred.weight), bias_(pred.bias) {
  bias_.resize(out_);
}

std::size_t PlanePrediction::buffer_bytes() const { return sizeof(float) * kPixels * in_; }

namespace {

/// 8 pixels of [x, channel] become [channel, x].
EVENTGAN_EIGHT_INLINE void transpose(Eight (&pixels)[kEight]) {
  Eight pairs[kEight], fours[kEight];
#pragma GCC unroll 4
  for (int i = 0; i < kEight; i += 2) {
    const Eight a = pixels[i], b = pixels[i + 1];
    pairs[i] = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
    pairs[i + 1] = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
  }
#pragma GCC unroll 4
  for (int i = 0; i < kEight / 2; ++i) {
    const int from = i / 2 * 4 + i % 2;
    const Eight a = pairs[from], b = pairs[from + 2];
    fours[i / 2 * 4 + i % 2 * 2] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
    fours[i / 2 * 4 + i % 2 * 2 + 1] = __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  }
#pragma GCC unroll 4
  for (int i = 0; i < kEight / 2; ++i) {
    const Eight a = fours[i], b = fours[i + 4];
    pixels[i] = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
    pixels[i + 4] = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
  }
}

}  // namespace

EVENTGAN_AVX2
bool PlanePrediction::run(const float* pixels, ImageSize size, int y, float* volume,
                          std::byte* buffer) const {
  constexpr int kVectors = kPixels / kEight, kPlanes = 2;
  auto* const channels = reinterpret_cast<float*>(buffer);
  const auto plane_values = static_cast<std::ptrdiff_t>(size.pixel_count());
  EightBits largest{};
  for (int x = 0; x < size.width; x += kPixels, pixels += kPixels * in_) {
    for (int i = 0; i < in_; i += kEight) {
#pragma GCC unroll 4
      for (int v = 0; v < kVectors; ++v) {
        Eight lanes[kEight];
#pragma GCC unroll 8
        for (int p = 0; p < kEight; ++p) lanes[p] = eight(pixels + (v * kEight + p) * in_ + i);
        transpose(lanes);
#pragma GCC unroll 8
        for (int c = 0; c < kEight; ++c) keep(lanes[c], channels + (i + c) * kPixels + v * kEight);
      }
    }
    const int count = std::min(kPixels, size.width - x);
    for (int o = 0; o < out_; o += kPlanes) {
      const float* weights = &weights_[static_cast<std::size_t>(o) * in_];
      Eight sums[kPlanes][kVectors];
#pragma GCC unroll 2
      for (int plane = 0; plane < kPlanes; ++plane) {
#pragma GCC unroll 4
        for (Eight& sum : sums[plane]) sum = Eight{} + bias_[o + plane];
      }
      for (int i = 0; i < in_; ++i) {
#pragma GCC unroll 2
        for (int plane = 0; plane < kPlanes; ++plane) {
#pragma GCC unroll 4
          for (int v = 0; v < kVectors; ++v) {
            sums[plane][v] += eight(channels + i * kPixels + v * kEight) * weights[plane * in_ + i];
          }
        }
      }
#pragma GCC unroll 2
      for (int plane = 0; plane < kPlanes; ++plane) {
        float* to =
            volume + (o + plane) * plane_values + static_cast<std::ptrdiff_t>(y) * size.width + x;
#pragma GCC unroll 4
        for (Eight& sum : sums[plane]) {
          const EightBits bits = reinterpret_cast<EightBits>(sum) & 0x7fffffff;
          largest = bits > largest ? bits : largest;
          sum = sum <= 0 ? Eight{} : sum;
        }
        if (count == kPixels) {
          // The next pixels but one: written long ago, if ever.
          __builtin_prefetch(to + 2 * kPixels, 1);
          __builtin_prefetch(to + 2 * kPixels + kPixels / 2, 1);
#pragma GCC unroll 4
          for (int v = 0; v < kVectors; ++v) {
            *reinterpret_cast<EightInMemory*>(to + v * kEight) = sums[plane][v];
          }
        } else {
          std::memcpy(to, sums[plane], count * sizeof(float));
        }
      }
    }
  }
  std::uint32_t most = 0;
  for (int lane = 0; lane < kEight; ++lane) most = std::max<std::uint32_t>(most, largest[lane]);
  return most < std::bit_cast<std::uint32_t>(std::numeric_limits<float>::infinity());
}

}  // namespace eventgan
