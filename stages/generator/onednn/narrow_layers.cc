#include "stages/generator/onednn/narrow_layers.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <type_traits>

#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/weights.h"

#if defined(__x86_64__)
#include <immintrin.h>
// Of BF16 and VNNI a compiler takes by itself nothing that is here: add_products does.
#define EVENTGAN_AVX512 \
  __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx512bf16,avx512vnni,avx2,fma")))
#else
#define EVENTGAN_AVX512
#endif
#define EVENTGAN_LANES_INLINE EVENTGAN_AVX512 __attribute__((always_inline)) inline

namespace eventgan {
namespace {

constexpr int kLanes = 16;
constexpr int kOutputs = NarrowLayers::kChannels;
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
using WholeLanes = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));
using Bits = std::uint32_t __attribute__((vector_size(kLanes * sizeof(std::uint32_t))));
/// 32 bits of what a pixel holds: a channel in float32, two in bfloat16, four in bytes. What moves
/// and shuffles lanes takes them as floats, whatever they are.
using Word = NarrowLayers::Word;
template <class Stored>
constexpr int kWordChannels = sizeof(Word) / sizeof(Stored);
template <class Stored>
using Sums = std::conditional_t<std::is_same_v<Stored, std::uint8_t>, WholeLanes, Lanes>;
/// Pixels that are computed at once.
constexpr int kPixels = NarrowLayers::kPixels, kVectors = kPixels / kLanes;
/// The same anywhere in memory.
using LanesInMemory =
    float __attribute__((vector_size(kLanes * sizeof(float)), aligned(alignof(float)), may_alias));

EVENTGAN_LANES_INLINE Lanes load(const float* values) {
  return *reinterpret_cast<const LanesInMemory*>(values);
}

EVENTGAN_LANES_INLINE void store(Lanes lanes, float* values) {
  *reinterpret_cast<LanesInMemory*>(values) = lanes;
}

EVENTGAN_LANES_INLINE Lanes leaky_relu(Lanes sum) { return sum > 0 ? sum : sum * kLeakySlope; }

EVENTGAN_LANES_INLINE Lanes evens(Lanes a, Lanes b) {
  return __builtin_shufflevector(a, b, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
}

EVENTGAN_LANES_INLINE Lanes odds(Lanes a, Lanes b) {
  return __builtin_shufflevector(a, b, 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
}

EVENTGAN_LANES_INLINE Lanes first_in_turns(Lanes a, Lanes b) {
  return __builtin_shufflevector(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
}

EVENTGAN_LANES_INLINE Lanes last_in_turns(Lanes a, Lanes b) {
  return __builtin_shufflevector(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15,
                                 31);
}

/// 16 pixels of [x, channel] become [channel, x].
template <int kChannels>
EVENTGAN_LANES_INLINE void to_planes(Lanes (&lanes)[kChannels]) {
#pragma GCC unroll 4
  for (int rounds = 1; rounds < kChannels; rounds *= 2) {
    Lanes halves[kChannels];
#pragma GCC unroll 8
    for (int i = 0; i < kChannels / 2; ++i) {
      halves[i] = evens(lanes[2 * i], lanes[2 * i + 1]);
      halves[i + kChannels / 2] = odds(lanes[2 * i], lanes[2 * i + 1]);
    }
#pragma GCC unroll 16
    for (int i = 0; i < kChannels; ++i) lanes[i] = halves[i];
  }
}

/// And back.
template <int kChannels>
EVENTGAN_LANES_INLINE void to_pixels(Lanes (&lanes)[kChannels]) {
#pragma GCC unroll 4
  for (int rounds = 1; rounds < kChannels; rounds *= 2) {
    Lanes turns[kChannels];
#pragma GCC unroll 8
    for (int i = 0; i < kChannels / 2; ++i) {
      turns[2 * i] = first_in_turns(lanes[i], lanes[i + kChannels / 2]);
      turns[2 * i + 1] = last_in_turns(lanes[i], lanes[i + kChannels / 2]);
    }
#pragma GCC unroll 16
    for (int i = 0; i < kChannels; ++i) lanes[i] = turns[i];
  }
}

/// A row [x, word] into planes: planes[word * pitch + 1 + x].
template <int kWords>
EVENTGAN_LANES_INLINE void read_row(const float* pixels, int width, std::ptrdiff_t pitch,
                                    float* planes) {
  const auto read = [&](const float* from, int x) EVENTGAN_AVX512 {
    Lanes lanes[kWords];
#pragma GCC unroll 16
    for (int i = 0; i < kWords; ++i) lanes[i] = load(from + i * kLanes);
    to_planes(lanes);
#pragma GCC unroll 16
    for (int i = 0; i < kWords; ++i) store(lanes[i], planes + i * pitch + 1 + x);
  };
  int x = 0;
  for (; x + kLanes <= width; x += kLanes) read(pixels + x * kWords, x);
  // What is behind the row may be anything, but its neighbour here is zero.
  if (x < width) {
    float rest[kWords * kLanes] = {};
    std::memcpy(rest, pixels + x * kWords, (width - x) * kWords * sizeof(float));
    read(rest, x);
  }
}

/// Adds to each sum what a word of a pixel makes with a word of weights.
EVENTGAN_LANES_INLINE void add_products(float, Lanes words, Word weights, Lanes& sums) {
  sums += words * std::bit_cast<float>(weights);
}

#if defined(__x86_64__)
EVENTGAN_LANES_INLINE void add_products(Bfloat16, Lanes words, Word weights, Lanes& sums) {
  sums = reinterpret_cast<Lanes>(
      _mm512_dpbf16_ps(reinterpret_cast<__m512>(sums), reinterpret_cast<__m512bh>(words),
                       reinterpret_cast<__m512bh>(_mm512_set1_epi32(static_cast<int>(weights)))));
}

EVENTGAN_LANES_INLINE void add_products(std::uint8_t, Lanes words, Word weights, WholeLanes& sums) {
  sums = reinterpret_cast<WholeLanes>(
      _mm512_dpbusd_epi32(reinterpret_cast<__m512i>(sums), reinterpret_cast<__m512i>(words),
                          _mm512_set1_epi32(static_cast<int>(weights))));
}
#else
template <class Stored, class Sum>
void add_products(Stored, Lanes, Word, Sum&) {
  throw std::logic_error("expected a processor with AVX-512");
}
#endif

EVENTGAN_LANES_INLINE Lanes as_float(Lanes sums) { return sums; }
EVENTGAN_LANES_INLINE Lanes as_float(WholeLanes sums) {
  return __builtin_convertvector(sums, Lanes);
}

/// Adds what one row of a kernel makes of one row of planes of `words`, for kVectors x 16 pixels
/// whose leftmost neighbours begin at `planes`.
template <class Stored, int kVectors, int kSums>
EVENTGAN_LANES_INLINE void add_row(const float* planes, std::ptrdiff_t pitch, int words,
                                   int columns, const Word* weights,
                                   Sums<Stored> (&sums)[kVectors][kSums]) {
  for (int i = 0; i < words; ++i, planes += pitch) {
    for (int column = 0; column < columns; ++column, weights += kSums) {
      Lanes input[kVectors];
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) input[v] = load(planes + column + v * kLanes);
#pragma GCC unroll 16
      for (int o = 0; o < kSums; ++o) {
#pragma GCC unroll 2
        for (int v = 0; v < kVectors; ++v) {
          add_products(Stored{}, input[v], weights[o], sums[v][o]);
        }
      }
    }
  }
}

/// Whether none of the lanes' largest values is infinity or NaN, which as bits lies above it; other
/// numbers >= 0 lie below, in their order.
EVENTGAN_LANES_INLINE bool is_finite(const Bits (&largest)[kVectors]) {
  Word most = 0;
  for (const Bits& bits : largest) {
    for (int lane = 0; lane < kLanes; ++lane) most = std::max<Word>(most, bits[lane]);
  }
  return most < std::bit_cast<Word>(std::numeric_limits<float>::infinity());
}

/// A row of the volume, and what makes it of the last decoder's sums.
struct Prediction {
  const std::vector<float>& decoder_bias;
  const std::vector<float>& weights;  ///< [out, in]
  const std::vector<float>& bias;
  ImageSize size;
  float* row;  ///< of the first channel
};

/// For the pixels from x on. `largest`: of each lane's values, see is_finite.
EVENTGAN_LANES_INLINE void predict(Lanes (&sums)[kVectors][kOutputs], int x,
                                   const Prediction& prediction, Bits (&largest)[kVectors]) {
#pragma GCC unroll 2
  for (int v = 0; v < kVectors; ++v) {
#pragma GCC unroll 8
    for (int o = 0; o < kOutputs; ++o)
      sums[v][o] = leaky_relu(sums[v][o] + prediction.decoder_bias[o]);
  }
  const auto plane_stride = static_cast<std::ptrdiff_t>(prediction.size.pixel_count());
  const int pixels = std::min(kPixels, prediction.size.width - x);
  const float* weights = prediction.weights.data();
  float* plane = prediction.row + x;
  for (const float bias : prediction.bias) {
    Lanes values[kVectors] = {Lanes{} + bias, Lanes{} + bias};
#pragma GCC unroll 8
    for (int c = 0; c < kOutputs; ++c) {
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) values[v] += sums[v][c] * weights[c];
    }
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
      values[v] = values[v] <= 0 ? Lanes{} : values[v];
      const Bits bits = reinterpret_cast<Bits>(values[v]);
      largest[v] = bits > largest[v] ? bits : largest[v];
    }
    // The next pixels but one: written long ago, if ever.
    __builtin_prefetch(plane + 2 * kPixels, 1);
    __builtin_prefetch(plane + 2 * kPixels + kLanes, 1);
    if (pixels == kPixels) {
      store(values[0], plane);
      store(values[1], plane + kLanes);
    } else {
      std::memcpy(plane, values, pixels * sizeof(float));
    }
    weights += kOutputs;
    plane += plane_stride;
  }
}

std::ptrdiff_t rounded_up(std::ptrdiff_t values, std::ptrdiff_t step) {
  return (values + step - 1) / step * step;
}

/// Of a number of cache lines that is odd, so that the planes lie in different parts of a cache.
std::ptrdiff_t pitch_of(std::ptrdiff_t values) { return rounded_up(values, 2 * kLanes) + kLanes; }

/// `channels` weights one behind the other, as the activations that they belong to are stored.
Word packed_word(const float* weights, int channels) {
  if (channels == 1) return std::bit_cast<Word>(*weights);
  Word word = 0;
  for (int i = channels; i-- > 0;) {
    if (channels == 2) {
      Bfloat16 rounded;
      store_activations(weights + i, 1, &rounded);
      word = word << 16 | rounded.bits;
    } else {
      word = word << 8 | static_cast<std::uint8_t>(static_cast<std::int8_t>(weights[i]));
    }
  }
  return word;
}

/// Weights [group out, in, row, column] in the order [group, row, in / channels of a word, column,
/// out, in % them].
std::vector<Word> packed(const LayerNumbers& layer, int groups, int word_channels) {
  const int out = layer.out_channels / groups, in = layer.in_channels, side = layer.kernel;
  const int words = in / word_channels;
  std::vector<Word> weights;
  for (int i = 0; i < groups * side * words * side * out; ++i) {
    const int o = i / (side * words * side * out) * out + i % out;
    const int column = i / out % side;
    const int first = i / (out * side) % words * word_channels;
    const int row = i / (out * side * words) % side;
    float together[sizeof(Word)];
    for (int j = 0; j < word_channels; ++j) {
      together[j] = layer.weight[((o * in + first + j) * side + row) * side + column];
    }
    weights.push_back(packed_word(together, word_channels));
  }
  return weights;
}

/// What int8 multiplies the sums with; 1 elsewhere.
std::vector<float> scales_of(const LayerNumbers& layer) {
  std::vector<float> scales = layer.output_scales;
  scales.resize(layer.out_channels, 1);
  return scales;
}

/// 0 where there is none.
std::vector<float> bias_of(const LayerNumbers& layer) {
  std::vector<float> bias = bias_behind_scales(layer);
  bias.resize(layer.out_channels);
  return bias;
}

}  // namespace

bool NarrowLayers::fit(int base_channels, Precision precision) {
  // Without AVX-512 there is no bfloat16.
  return base_channels == kChannels && onednn_support(Precision::kBfloat16).able &&
         onednn_support(precision).native;
}

NarrowLayers::NarrowLayers(const LayerNumbers& head, const LayerNumbers& skip,
                           const LayerNumbers& phases, const LayerNumbers& pred, ImageSize size,
                           int stored_bytes, bool tiles, BufferLayout& layout)
    : inputs_(head.in_channels),
      size_(size),
      pitch_(pitch_of(rounded_up(size.width, 2 * kLanes) + 2 * kLanes)),
      small_pitch_(pitch_of(rounded_up(size.width / 2 + 1, kLanes) + 2)),
      head_(packed(head, 1, 1)),
      skip_(packed(skip, 1, sizeof(Word) / stored_bytes)),
      phases_(packed(phases, 2, sizeof(Word) / stored_bytes)),
      prediction_(pred.weight),
      head_bias_(head.bias),
      skip_bias_(bias_of(skip)),
      skip_scales_(scales_of(skip)),
      phases_bias_(bias_of(phases)),
      phases_scales_(scales_of(phases)),
      prediction_bias_(pred.bias) {
  std::size_t bytes = buffer_values() * sizeof(float);
  if (tiles) bytes = std::max(bytes, tiles_.emplace(skip, phases, size).buffer_bytes());
  buffer_ = layout.add(bytes);
}

EVENTGAN_AVX512
void NarrowLayers::head_row(const float* inputs, int y, std::byte* block, float* pixels) const {
  auto* rows = reinterpret_cast<float*>(block + buffer_);
  if (y == 0) std::memset(rows, 0, buffer_values() * sizeof(float));
  const auto planes_of = [&](int row) { return rows + row % 3 * inputs_ * pitch_; };
  for (int row = y == 0 ? 0 : y + 1; row < std::min(y + 2, size_.height); ++row) {
    for (int plane = 0; plane < inputs_; ++plane) {
      std::memcpy(planes_of(row) + plane * pitch_ + 1,
                  inputs + (static_cast<std::ptrdiff_t>(plane) * size_.height + row) * size_.width,
                  size_.width * sizeof(float));
    }
  }
  for (int x = 0; x < size_.width; x += kPixels) {
    Lanes sums[kVectors][kOutputs];
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
#pragma GCC unroll 8
      for (int o = 0; o < kOutputs; ++o) sums[v][o] = Lanes{} + head_bias_[o];
    }
    for (int row = std::max(y - 1, 0); row < std::min(y + 2, size_.height); ++row) {
      add_row<float>(planes_of(row) + x, pitch_, inputs_, 3,
                     head_.data() + (row - y + 1) * inputs_ * 3 * kOutputs, sums);
    }
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
#pragma GCC unroll 8
      for (Lanes& sum : sums[v]) sum = leaky_relu(sum);
      to_pixels(sums[v]);
#pragma GCC unroll 8
      for (int i = 0; i < kOutputs; ++i) {
        store(sums[v][i], pixels + (x + v * kLanes) * kOutputs + i * kLanes);
      }
    }
  }
}

template <class Stored>
EVENTGAN_AVX512 void NarrowLayers::read_rows(const Stored* small, const Stored* skip, int y,
                                             float* rows) const {
  if (y == 0) std::memset(rows, 0, buffer_values() * sizeof(float));
  constexpr int kWords = kChannels / kWordChannels<Stored>;
  const auto words_at = [](const Stored* pixels, std::ptrdiff_t pixel, int words) {
    return reinterpret_cast<const float*>(pixels) + pixel * words;
  };
  for (int row = y == 0 ? 0 : y + 1; row < std::min(y + 2, size_.height); ++row) {
    read_row<kWords>(words_at(skip, static_cast<std::ptrdiff_t>(row) * size_.width, kWords),
                     size_.width, pitch_, skip_planes(rows, row));
  }
  const ImageSize small_size = half_size(size_);
  const int p = (y + 1) / 2;
  if ((y == 0 || y % 2 == 1) && p < small_size.height) {
    read_row<2 * kWords>(
        words_at(small, static_cast<std::ptrdiff_t>(p) * small_size.width, 2 * kWords),
        small_size.width, small_pitch_, small_planes(rows, p));
  }
}

/// The sums over the doubled image: pixel x at 1 + x.
template <class Stored>
EVENTGAN_AVX512 void NarrowLayers::add_phases(const DecoderRow& edges, int y, float* rows) const {
  float* const sums_row = phase_planes(rows);
  if (edges.whole_row) {
    for (int x = 0; x < size_.width; ++x) {
      for (int o = 0; o < kOutputs; ++o) {
        sums_row[o * pitch_ + 1 + x] = edges.whole_row[x * kOutputs + o];
      }
    }
    return;
  }
  constexpr int kWords = 2 * kChannels / kWordChannels<Stored>;
  constexpr int kRowWeights = kWords * 2 * 2 * kOutputs;
  const float* const bias = phases_bias_.data() + y % 2 * 2 * kOutputs;
  const float* const scales = phases_scales_.data() + y % 2 * 2 * kOutputs;
  for (int q = 0; q <= size_.width / 2; q += kLanes) {
    Sums<Stored> sums[1][2 * kOutputs] = {};
    for (int row = 0; row < 2; ++row) {
      const int p = (y + 1) / 2 - 1 + row;
      if (p < 0 || p >= half_size(size_).height) continue;
      add_row<Stored>(small_planes(rows, p) + q, small_pitch_, kWords, 2,
                      phases_.data() + (y % 2 * 2 + row) * kRowWeights, sums);
    }
    Lanes values[2 * kOutputs];
#pragma GCC unroll 16
    for (int o = 0; o < 2 * kOutputs; ++o) values[o] = as_float(sums[0][o]) * scales[o] + bias[o];
      // Column q of the phases holds pixels 2q - 1, which is of phase 1, and 2q.
#pragma GCC unroll 8
    for (int o = 0; o < kOutputs; ++o) {
      float* const plane = sums_row + o * pitch_ + 2 * q;
      store(first_in_turns(values[kOutputs + o], values[o]), plane);
      store(last_in_turns(values[kOutputs + o], values[o]), plane + kLanes);
    }
  }
  if (edges.last_pixel) {
    for (int o = 0; o < kOutputs; ++o) sums_row[o * pitch_ + size_.width] = edges.last_pixel[o];
  }
}

template <class Stored>
EVENTGAN_AVX512 bool NarrowLayers::predict_planes(int y, float* rows, float* volume) const {
  const Prediction prediction{skip_bias_, prediction_, prediction_bias_, size_,
                              volume + static_cast<std::ptrdiff_t>(y) * size_.width};
  Bits largest[kVectors] = {};
  for (int x = 0; x < size_.width; x += kPixels) {
    constexpr int kWords = kChannels / kWordChannels<Stored>;
    Sums<Stored> sums[kVectors][kOutputs] = {};
    for (int row = std::max(y - 1, 0); row < std::min(y + 2, size_.height); ++row) {
      add_row<Stored>(skip_planes(rows, row) + x, pitch_, kWords, 3,
                      skip_.data() + (row - y + 1) * kWords * 3 * kOutputs, sums);
    }
    Lanes values[kVectors][kOutputs];
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
#pragma GCC unroll 8
      for (int o = 0; o < kOutputs; ++o) {
        values[v][o] = as_float(sums[v][o]) * skip_scales_[o] +
                       load(phase_planes(rows) + o * pitch_ + 1 + x + v * kLanes);
      }
    }
    predict(values, x, prediction, largest);
  }
  return is_finite(largest);
}

EVENTGAN_AVX512
bool NarrowLayers::predict_pixels(const float* pixels, int y, float* volume) const {
  const Prediction prediction{skip_bias_, prediction_, prediction_bias_, size_,
                              volume + static_cast<std::ptrdiff_t>(y) * size_.width};
  Bits largest[kVectors] = {};
  for (int x = 0; x < size_.width; x += kPixels, pixels += kPixels * kOutputs) {
    Lanes sums[kVectors][kOutputs];
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
#pragma GCC unroll 8
      for (int i = 0; i < kOutputs; ++i) {
        sums[v][i] = load(pixels + (v * kOutputs + i) * kLanes);
      }
      to_planes(sums[v]);
    }
    predict(sums, x, prediction, largest);
  }
  return is_finite(largest);
}

template <class Stored>
bool NarrowLayers::compute_row(const Stored* small, const Stored* skip, const DecoderRow& edges,
                               int y, std::byte* block, float* volume) const {
  if constexpr (std::is_same_v<Stored, Bfloat16>) {
    if (tiles_) {
      const float* sums = tiles_->sum_row(small, skip, edges, y, block + buffer_);
      return predict_pixels(sums + kChannels, y, volume);
    }
  }
  auto* rows = reinterpret_cast<float*>(block + buffer_);
  read_rows(small, skip, y, rows);
  add_phases<Stored>(edges, y, rows);
  return predict_planes<Stored>(y, rows, volume);
}

bool NarrowLayers::volume_row(const float* small, const float* skip, const DecoderRow& edges, int y,
                              std::byte* block, float* volume) const {
  return compute_row(small, skip, edges, y, block, volume);
}

bool NarrowLayers::volume_row(const Bfloat16* small, const Bfloat16* skip, const DecoderRow& edges,
                              int y, std::byte* block, float* volume) const {
  return compute_row(small, skip, edges, y, block, volume);
}

bool NarrowLayers::volume_row(const std::uint8_t* small, const std::uint8_t* skip,
                              const DecoderRow& edges, int y, std::byte* block,
                              float* volume) const {
  return compute_row(small, skip, edges, y, block, volume);
}

}  // namespace eventgan
