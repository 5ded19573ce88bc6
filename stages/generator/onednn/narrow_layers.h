#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "stages/generator/onednn/activation_rows.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/layer_numbers.h"
#include "stages/generator/onednn/narrow_tiles.h"

namespace eventgan {

/// The layers at full resolution of a network of base width 8: its head, and its last decoder with
/// the prediction behind it. oneDNN's kernels compute 16 output channels at once and write what the
/// next layer reads; here a register of AVX-512 holds 16 pixels of a row, whatever the channels
/// are: one of them in float32, two in bfloat16 (AVX512-BF16), four in int8 (VNNI). Of the last
/// decoder nothing goes to memory but the volume. The head and the prediction are float32 in every
/// precision. Thread safe.
class NarrowLayers {
 public:
  using Word = std::uint32_t;
  static constexpr int kChannels = 8;
  /// Counts up with what changes their bytes.
  static constexpr int kVersion = 2;

  /// Whether a network of this base width has them, on this processor as oneDNN sees it.
  static bool fit(int base_channels, Precision precision);

  /// `head`, `skip` and `phases` (of the last decoder) and `pred`. stored_bytes: of an activation.
  /// `tiles`: the processor has AMX and activations are bfloat16. Adds its buffer to `layout`.
  NarrowLayers(const LayerNumbers& head, const LayerNumbers& skip, const LayerNumbers& phases,
               const LayerNumbers& pred, ImageSize size, int stored_bytes, bool tiles,
               BufferLayout& layout);

  // Rows are computed in order, from row 0 on, where `fit` says so. `block` is what `layout` is of;
  // between two rows of an image nothing else may write there.

  /// Pixels that are computed at once, and may be written behind the end of a row of the head.
  static constexpr int kPixels = 32;

  /// Row y of the head, LeakyReLU included: pixels [x, channel]. inputs: [input, y, x].
  void head_row(const float* inputs, int y, std::byte* block, float* pixels) const;

  /// Row y of the volume [channel, y, x], from the last decoder's inputs as they are stored: small
  /// [y, x, 16] and skip [y, x, 8], as many bytes a value as the constructor was told. edges:
  /// `whole_row` and `last_pixel` alone. Whether all of its values are finite; what lies behind the
  /// row's end may make that false.
  bool volume_row(const float* small, const float* skip, const DecoderRow& edges, int y,
                  std::byte* block, float* volume) const;
  bool volume_row(const Bfloat16* small, const Bfloat16* skip, const DecoderRow& edges, int y,
                  std::byte* block, float* volume) const;
  bool volume_row(const std::uint8_t* small, const std::uint8_t* skip, const DecoderRow& edges,
                  int y, std::byte* block, float* volume) const;

 private:
  template <class Stored>
  void read_rows(const Stored* small, const Stored* skip, int y, float* rows) const;
  template <class Stored>
  void add_phases(const DecoderRow& edges, int y, float* rows) const;
  template <class Stored>
  bool predict_planes(int y, float* rows, float* volume) const;
  bool predict_pixels(const float* pixels, int y, float* volume) const;
  template <class Stored>
  bool compute_row(const Stored* small, const Stored* skip, const DecoderRow& edges, int y,
                   std::byte* block, float* volume) const;

  float* skip_planes(float* rows, int y) const { return rows + y % 3 * kChannels * pitch_; }
  float* phase_planes(float* rows) const { return rows + 3 * kChannels * pitch_; }
  float* small_planes(float* rows, int p) const {
    return rows + 4 * kChannels * pitch_ + p % 2 * 2 * kChannels * small_pitch_;
  }
  std::size_t buffer_values() const { return 4 * kChannels * (pitch_ + small_pitch_); }

  int inputs_;  ///< of the head
  ImageSize size_;
  std::optional<NarrowTiles> tiles_;
  /// From a channel of a row to the next: a row has a zero before its first pixel and zeros behind
  /// its last one.
  std::ptrdiff_t pitch_;
  std::ptrdiff_t small_pitch_;
  std::size_t buffer_ = 0;
  // [row, word in, column, out], but of the phases [row phase, row, word in, column, column phase,
  // out].
  std::vector<Word> head_, skip_, phases_;
  std::vector<float> prediction_;  ///< [out, in]
  std::vector<float> head_bias_, skip_bias_, skip_scales_, phases_bias_, phases_scales_,
      prediction_bias_;
};

}  // namespace eventgan
