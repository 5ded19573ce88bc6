#include "stages/generator/onednn/winograd.h"

#include <algorithm>
#include <array>

#include "stages/generator/onednn/detail/onednn_versions.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/weights.h"

namespace eventgan {
namespace {

/// A product of a row (column) of a tile: which of the row's sums it is added to, which product of
/// that sum it is, and what of the kernel it multiplies. What of the inputs: `input` of the rule.
struct Term {
  int sum = 0;
  int place = 0;
  std::array<double, 3> kernel{};
};

// Rules by which a row of a tile's inputs d becomes its two outputs. Rows and columns of a tile are
// summed so: sum kSums i + j has sum i of rows and j of columns.

/// F(2, 3): what a kernel g makes of four inputs.
struct PlainRule {
  static constexpr int kInputs = 4, kSums = 4;
  static constexpr std::array<Term, 4> kTerms = {
      {{0, 0, {1, 0, 0}}, {1, 0, {0.5, 0.5, 0.5}}, {2, 0, {0.5, -0.5, 0.5}}, {3, 0, {0, 0, 1}}}};
  template <class At>
  static EVENTGAN_EIGHT_INLINE Eight input(int term, At&& d) {
    switch (term) {
      case 0:
        return d(0) - d(2);
      case 1:
        return d(1) + d(2);
      case 2:
        return d(2) - d(1);
      default:
        return d(1) - d(3);
    }
  }
  template <class At>
  static EVENTGAN_EIGHT_INLINE Eight output(int pixel, At&& sum) {
    return pixel == 0 ? sum(0) + sum(1) + sum(2) : sum(1) - sum(2) - sum(3);
  }
};

/// The same of a doubled row, whose four inputs are a, a, b, b: a (g0 + g1) + b g2 and
/// a g0 + b (g1 + g2). If the image ends before the last input, the last output has no b g2: the
/// third input here is what there is too much of b.
struct DoubledRule {
  static constexpr int kInputs = 3;
  static constexpr std::array<Term, 4> kTerms = {
      {{1, 0, {1, 0.5, 0}}, {1, 1, {0, 0.5, 1}}, {2, 0, {0, 0.5, 0}}, {3, 0, {0, 0, 1}}}};
  template <class At>
  static EVENTGAN_EIGHT_INLINE Eight input(int term, At&& d) {
    switch (term) {
      case 0:
        return d(0);
      case 1:
        return d(1);
      case 2:
        return d(0) - d(1);
      default:
        return d(2);
    }
  }
};

/// A kernel with stride 2: d0 g0 + d1 g1 + d2 g2 and d2 g0 + d3 g1 + d4 g2. Five products where the
/// kernel has six.
struct StridedRule {
  static constexpr int kInputs = 5, kSums = 3;
  static constexpr std::array<Term, 5> kTerms = {{{0, 0, {1, 0, 0}},
                                                  {0, 1, {0, 1, 0}},
                                                  {1, 0, {1, 0, 1}},
                                                  {2, 0, {0, 0, 1}},
                                                  {2, 1, {0, 1, 0}}}};
  template <class At>
  static EVENTGAN_EIGHT_INLINE Eight input(int term, At&& d) {
    switch (term) {
      case 0:
        return d(0) - d(2);
      case 1:
        return d(1);
      case 2:
        return d(2);
      case 3:
        return d(4) - d(2);
      default:
        return d(3);
    }
  }
  template <class At>
  static EVENTGAN_EIGHT_INLINE Eight output(int pixel, At&& sum) {
    return pixel == 0 ? sum(0) + sum(1) : sum(1) + sum(2);
  }
};

/// Products of a row's sum.
template <class Rule>
constexpr int places(int sum) {
  int count = 0;
  for (const Term& term : Rule::kTerms) count += term.sum == sum;
  return count;
}

/// Which product of its tile's sum that of two terms is.
template <class Rule>
constexpr int place_of(int row_term, int column_term) {
  return Rule::kTerms[row_term].place * places<Rule>(Rule::kTerms[column_term].sum) +
         Rule::kTerms[column_term].place;
}

/// Sixteen registers hold 12 sums, an input and weights: of 6 tiles with 16 outputs, or of 12 with
/// 8.
int vectors_of(int out) { return out % (2 * kEight) == 0 ? 2 : 1; }
int group_of(int out) { return 12 / vectors_of(out); }

/// Tiles whose inputs and sums stay in a second-level cache, in whole groups.
constexpr int kMostTiles = 96;
int tiles_at_once(int bytes_of_tile) {
  constexpr int kBytesOfTiles = 1 << 17, kGroups = 12;
  return std::clamp(kBytesOfTiles / bytes_of_tile / kGroups, 1, kMostTiles / kGroups) * kGroups;
}

}  // namespace

bool winograd_fits(int base_channels, Precision precision) {
#if defined(__x86_64__)
  // Without AVX-512 there is no bfloat16. Of AMD's family 19h only Zen 4 has AVX-512, in two halves
  // of 256 bits, so that oneDNN's wider convolutions gain nothing by it.
  const OnednnSupport bfloat16 = onednn_support(Precision::kBfloat16);
  return base_channels % kEight == 0 && precision == Precision::kFloat32 &&
         processor_has(dnnl::cpu_isa::avx2) && __builtin_cpu_supports("fma") &&
         (!bfloat16.able || (bfloat16.native && __builtin_cpu_is("amdfam19h")));
#else
  static_cast<void>(base_channels), static_cast<void>(precision);
  return false;
#endif
}

struct WinogradConvolution::Block {
  std::array<int, kMostTiles> tiles;  ///< their numbers, row by row
  int count = 0;
  int columns = 0;           ///< of tiles
  bool last_row = false;     ///< some tile's doubled rows end before its last one
  bool last_column = false;  ///< and columns
  float* values = nullptr;   ///< [tile / group's, sum, product's in / 8, tile % group's, in % 8]
  float* sums = nullptr;     ///< [tile / group's, sum, out / vector's, tile % group's, out % it]
};

template <class Rule, class Other>
void WinogradConvolution::plan_sums(int other_channels) {
  sums_ = Rule::kSums * Rule::kSums;
  for (int sum = 0; sum < sums_; ++sum) {
    const int row = sum / Rule::kSums, column = sum % Rule::kSums;
    plain_depth_[sum] = in_ * places<Rule>(row) * places<Rule>(column);
    depth_before_[sum + 1] = depth_before_[sum] + plain_depth_[sum] +
                             other_channels * places<Other>(row) * places<Other>(column);
  }
}

template <class Rule>
void WinogradConvolution::pack(const LayerNumbers& layer, const std::array<int, 16>& behind) {
  const int in = layer.in_channels, width = vectors_of(out_) * kEight;
  const int side = sums_ == 16 ? 4 : 3;
  constexpr int kTerms = Rule::kTerms.size();
  const float* kernel = layer.weight.data();
  float* const weights = weights_.front().values;
  for (int o = 0; o < out_; ++o) {
    for (int i = 0; i < in; ++i, kernel += 9) {
      for (int row = 0; row < kTerms; ++row) {
        const auto& rows = Rule::kTerms[row].kernel;
        std::array<double, 3> taps;
        for (int x = 0; x < 3; ++x) {
          taps[x] = rows[0] * kernel[x] + rows[1] * kernel[3 + x] + rows[2] * kernel[6 + x];
        }
        for (int column = 0; column < kTerms; ++column) {
          const auto& columns = Rule::kTerms[column].kernel;
          const int sum = Rule::kTerms[row].sum * side + Rule::kTerms[column].sum;
          const std::ptrdiff_t depth = depth_before_[sum + 1] - depth_before_[sum];
          const std::ptrdiff_t channel = behind[sum] + place_of<Rule>(row, column) * in + i;
          weights[depth_before_[sum] * static_cast<std::ptrdiff_t>(out_) +
                  (o / width * depth + channel) * width + o % width] =
              static_cast<float>(columns[0] * taps[0] + columns[1] * taps[1] +
                                 columns[2] * taps[2]);
        }
      }
    }
  }
}

WinogradConvolution::WinogradConvolution(const LayerNumbers& layer, int stride, float slope,
                                         const LayerNumbers* doubled)
    : in_(layer.in_channels),
      small_(doubled ? doubled->in_channels : 0),
      out_(layer.out_channels),
      stride_(stride),
      slope_(slope),
      bias_(out_ / kEight) {
  for (std::size_t o = 0; o < layer.bias.size(); ++o) {
    bias_[o / kEight].values[o % kEight] = layer.bias[o];
  }
  if (stride == 1) {
    plan_sums<PlainRule, DoubledRule>(small_);
  } else {
    plan_sums<StridedRule, DoubledRule>(0);
  }
  const int depth = depth_before_[sums_];
  weights_.resize(static_cast<std::size_t>(depth) * out_ / kEight);
  tiles_at_once_ = tiles_at_once(static_cast<int>(sizeof(float)) * (depth + sums_ * out_));
  if (stride == 1) {
    pack<PlainRule>(layer, {});
  } else {
    pack<StridedRule>(layer, {});
  }
  if (doubled) pack<DoubledRule>(*doubled, plain_depth_);
}

std::size_t WinogradConvolution::buffer_bytes() const {
  return sizeof(float) * tiles_at_once_ * (depth_before_[sums_] + sums_ * out_);
}

ImageSize WinogradConvolution::output_size(ImageSize input) const {
  return stride_ == 1 ? input : half_size(input);
}

int WinogradConvolution::tile_rows(ImageSize input) const {
  return tiles_along(output_size(input).height);
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
EVENTGAN_AVX2 void WinogradConvolution::multiply_sums(const Block& block) const {
  constexpr int kWidth = kVectors * kEight;
  const int groups = (block.count + kTiles - 1) / kTiles;
  const std::ptrdiff_t group_values = kTiles * depth_before_[sums_];
  const std::ptrdiff_t group_sums = kTiles * sums_ * out_;
  const float* weights = weights_.front().values;
  for (int sum = 0; sum < sums_; ++sum) {
    const int depth = depth_before_[sum + 1] - depth_before_[sum];
    const bool plain_alone =
        small_ > 0 && ((sum / 4 == 3 && !block.last_row) || (sum % 4 == 3 && !block.last_column));
    const int eights = (plain_alone ? plain_depth_[sum] : depth) / kEight;
    for (int out = 0; out < out_; out += kWidth, weights += depth * kWidth) {
      for (int group = 0; group < groups; ++group) {
        multiply<kTiles, kVectors>(
            block.values + group * group_values + kTiles * depth_before_[sum], weights, eights,
            block.sums + group * group_sums + kTiles * (sum * out_ + out));
      }
    }
  }
}

namespace {

/// Where a tile's inputs of a rule go: to `base` + places[sum] for each sum.
struct TileValues {
  float* base = nullptr;
  const std::ptrdiff_t* places = nullptr;
  int group = 0;
};

/// pixel(y, x, channel): a tile's inputs. last_row, last_column: else there are no last ones, nor
/// their terms.
template <class Rule, int kSums, class Pixel>
EVENTGAN_EIGHT_INLINE void read_tile(Pixel&& pixel, int channels, bool last_row, bool last_column,
                                     const TileValues& to) {
  constexpr int kTerms = Rule::kTerms.size();
  for (int channel = 0; channel < channels; channel += kEight) {
#pragma GCC unroll 5
    for (int y = 0; y < kTerms; ++y) {
      if (y == kTerms - 1 && !last_row) break;
      Eight row[Rule::kInputs];
#pragma GCC unroll 5
      for (int x = 0; x < Rule::kInputs; ++x) {
        if (x == Rule::kInputs - 1 && !last_column) break;
        row[x] = Rule::input(y, [&](int d) EVENTGAN_AVX2 { return pixel(d, x, channel); });
      }
#pragma GCC unroll 5
      for (int x = 0; x < kTerms; ++x) {
        if (x == kTerms - 1 && !last_column) break;
        const int sum = Rule::kTerms[y].sum * kSums + Rule::kTerms[x].sum;
        keep(Rule::input(x, [&](int d) EVENTGAN_AVX2 { return row[d]; }),
             to.base + to.places[sum] + (place_of<Rule>(y, x) * channels + channel) * to.group);
      }
    }
  }
}

}  // namespace

template <class Rule>
EVENTGAN_AVX2 void WinogradConvolution::read_input(const Images& images, const Block& block) const {
  // What is stored might alter members, as far as a compiler knows.
  const int group = group_of(out_), in = in_, columns = block.columns;
  const std::ptrdiff_t group_values = static_cast<std::ptrdiff_t>(group) * depth_before_[sums_];
  std::array<std::ptrdiff_t, 16> places{};
  for (int sum = 0; sum < sums_; ++sum) {
    places[sum] = static_cast<std::ptrdiff_t>(group) * depth_before_[sum];
  }
  const int height = images.size.height, width = images.size.width;
  const std::ptrdiff_t row_values = static_cast<std::ptrdiff_t>(width) * in;
  const float* const input = images.input;
  const int step = 2 * stride_, before = small_ > 0 ? 2 : 1;
  for (int i = 0; i < block.count; ++i) {
    const int tile = block.tiles[i];
    const int top = step * (tile / columns) - before;
    const int left = step * (tile % columns) - before;
    const TileValues to{block.values + i / group * group_values + i % group * kEight, places.data(),
                        group};
    if (top >= 0 && left >= 0 && top + Rule::kInputs <= height && left + Rule::kInputs <= width) {
      const float* corner = input + top * row_values + left * in;
      const auto pixel = [&](int y, int x, int channel) EVENTGAN_AVX2 {
        return eight(corner + y * row_values + x * in + channel);
      };
      read_tile<Rule, Rule::kSums>(pixel, in, true, true, to);
    } else {
      const auto pixel = [&](int y, int x, int channel) EVENTGAN_AVX2 {
        y += top, x += left;
        if (y < 0 || x < 0 || y >= height || x >= width) return Eight{};
        return eight(input + y * row_values + x * in + channel);
      };
      read_tile<Rule, Rule::kSums>(pixel, in, true, true, to);
    }
  }
}

EVENTGAN_AVX2
void WinogradConvolution::read_small(const Images& images, const Block& block) const {
  const int group = group_of(out_), in = small_, columns = block.columns;
  const std::ptrdiff_t group_values = static_cast<std::ptrdiff_t>(group) * depth_before_[sums_];
  std::array<std::ptrdiff_t, 16> places{};
  for (int sum = 0; sum < sums_; ++sum) {
    places[sum] = static_cast<std::ptrdiff_t>(group) * (depth_before_[sum] + plain_depth_[sum]);
  }
  const ImageSize size = half_size(images.size);
  const int height = size.height, width = size.width;
  const float* const small = images.small;
  const std::ptrdiff_t row_values = static_cast<std::ptrdiff_t>(width) * in;
  for (int i = 0; i < block.count; ++i) {
    const int tile = block.tiles[i];
    const int top = tile / columns - 1, left = tile % columns - 1;
    const TileValues to{block.values + i / group * group_values + i % group * kEight, places.data(),
                        group};
    if (!block.last_row && !block.last_column && top >= 0 && left >= 0 && top + 2 <= height &&
        left + 2 <= width) {
      const float* corner = small + top * row_values + left * in;
      const auto pixel = [&](int y, int x, int channel) EVENTGAN_AVX2 {
        return eight(corner + y * row_values + x * in + channel);
      };
      read_tile<DoubledRule, PlainRule::kSums>(pixel, in, false, false, to);
    } else {
      const bool ends_above = images.size.height % 2 == 1 && top == height - 2;
      const bool ends_left = images.size.width % 2 == 1 && left == width - 2;
      const auto pixel = [&](int y, int x, int channel) EVENTGAN_AVX2 {
        if ((y == 2 && !ends_above) || (x == 2 && !ends_left)) return Eight{};
        y = top + std::min(y, 1), x = left + std::min(x, 1);
        if (y < 0 || x < 0 || y >= height || x >= width) return Eight{};
        return eight(small + y * row_values + x * in + channel);
      };
      read_tile<DoubledRule, PlainRule::kSums>(pixel, in, block.last_row, block.last_column, to);
    }
  }
}

template <class Rule>
EVENTGAN_AVX2 void WinogradConvolution::write_output(const Images& images, const Block& block,
                                                     float* output, int output_row,
                                                     bool add) const {
  const int group = group_of(out_), panel = vectors_of(out_) * kEight;
  const int out = out_, columns = block.columns;
  const float slope = slope_;
  const ImageSize size = output_size(images.size);
  const int height = size.height, width = size.width;
  const std::ptrdiff_t sum_values = static_cast<std::ptrdiff_t>(group) * out;
  const std::ptrdiff_t group_values = sums_ * sum_values;
  const int before = small_ > 0 ? 1 : 0;
  for (int i = 0; i < block.count; ++i) {
    const int tile = block.tiles[i];
    const int top = 2 * (tile / columns) - before;
    const int left = 2 * (tile % columns) - before;
    const float* tile_sums = block.sums + i / group * group_values + i % group * panel;
    for (int channel = 0; channel < out; channel += kEight) {
      const float* sums = tile_sums + channel / panel * group * panel + channel % panel;
      Eight rows[2][Rule::kSums];
#pragma GCC unroll 4
      for (int x = 0; x < Rule::kSums; ++x) {
        const auto sum = [&](int y) EVENTGAN_AVX2 {
          return eight(sums + (y * Rule::kSums + x) * sum_values);
        };
        rows[0][x] = Rule::output(0, sum);
        rows[1][x] = Rule::output(1, sum);
      }
      const Eight bias = eight(bias_[channel / kEight].values);
#pragma GCC unroll 2
      for (int y = 0; y < 2; ++y) {
        if (top + y < 0 || top + y >= height) continue;
#pragma GCC unroll 2
        for (int x = 0; x < 2; ++x) {
          if (left + x < 0 || left + x >= width) continue;
          float* to = output +
                      (static_cast<std::ptrdiff_t>(top + y - output_row) * width + left + x) * out +
                      channel;
          Eight sum = bias + Rule::output(x, [&](int at) EVENTGAN_AVX2 { return rows[y][at]; });
          if (add) sum += eight(to);
          keep(sum > 0 ? sum : sum * slope, to);
        }
      }
    }
  }
}

template <class TileAt>
void WinogradConvolution::run_blocks(const Images& images, int count, TileAt&& tile_at,
                                     float* output, int output_row, bool add,
                                     std::byte* buffer) const {
  Block block;
  const int columns = block.columns = tiles_along(output_size(images.size).width);
  const int rows = tile_rows(images.size);
  block.values = reinterpret_cast<float*>(buffer);
  block.sums = block.values + tiles_at_once_ * depth_before_[sums_];
  for (int first = 0; first < count; first += block.count) {
    block.count = std::min(tiles_at_once_, count - first);
    for (int i = 0; i < block.count; ++i) block.tiles[i] = tile_at(first + i);
    if (stride_ == 1) {
      read_input<PlainRule>(images, block);
    } else {
      read_input<StridedRule>(images, block);
    }
    if (small_ > 0) {
      const auto some = [&](auto&& is_last) {
        return std::any_of(block.tiles.begin(), block.tiles.begin() + block.count, is_last);
      };
      block.last_row =
          images.size.height % 2 == 1 && some([&](int tile) { return tile / columns == rows - 1; });
      block.last_column = images.size.width % 2 == 1 &&
                          some([&](int tile) { return tile % columns == columns - 1; });
      read_small(images, block);
    }
    if (vectors_of(out_) == 2) {
      multiply_sums<6, 2>(block);
    } else {
      multiply_sums<12, 1>(block);
    }
    if (stride_ == 1) {
      write_output<PlainRule>(images, block, output, output_row, add);
    } else {
      write_output<StridedRule>(images, block, output, output_row, add);
    }
  }
}

void WinogradConvolution::run(const Images& images, int first, int end, float* output,
                              int output_row, bool add, std::byte* buffer) const {
  const int columns = tiles_along(output_size(images.size).width);
  run_blocks(
      images, (end - first) * columns, [&](int i) { return first * columns + i; }, output,
      output_row, add, buffer);
}

void WinogradConvolution::run(const Images& images, std::span<const int> tiles, float* output,
                              int output_row, bool add, std::byte* buffer) const {
  run_blocks(
      images, static_cast<int>(tiles.size()), [&](int i) { return tiles[i]; }, output, output_row,
      add, buffer);
}

}  // namespace eventgan
