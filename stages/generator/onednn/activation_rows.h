#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace eventgan {

/// Upper half of a float32, as bfloat16 is.
struct Bfloat16 {
  std::uint16_t bits = 0;
};

// The engine's own loops over activations, [y, x, channel] with channels contiguous. Stored as
// float32, as bfloat16 (nearest, ties to even; NaN stays NaN), or as uint8 (nearest, halves up,
// clipped to 0..255; the value has been divided by the tensor's scale; NaN becomes 0). No
// multiplication is followed by an addition, so that the result is the same with and without fused
// instructions. Thread safe.

void store_activations(const float* values, std::size_t count, float* stored);
void store_activations(const float* values, std::size_t count, Bfloat16* stored);
void store_activations(const float* values, std::size_t count, std::uint8_t* stored);

/// Activations stored in 8 bits, and those of them that are 255: what lies beyond a tensor's range,
/// which is clipped to it, and the little that lies at its end. Other types are not counted: they
/// hold what they are given. Not thread safe.
struct SaturationCount {
  std::size_t stored = 0;
  std::size_t saturated = 0;

  void add(const std::uint8_t* activations, std::size_t count);
  void add(const float*, std::size_t) {}
  void add(const Bfloat16*, std::size_t) {}
  double share() const { return stored == 0 ? 0 : double(saturated) / double(stored); }
};

/// Where one row of a decoder's output comes from.
struct DecoderRow {
  int width = 0;         ///< of this part of the output row, pixels
  int channels = 0;      ///< of the output
  int row_phase = 0;     ///< 0: even row, 1: odd row
  int column_phase = 0;  ///< the same of the first pixel
  /// [x, channel]: what the skip connection adds, bias included; may be overwritten.
  float* skip = nullptr;
  /// [pixel, sub-pixel phase, channel]: the row of phase_kernel's output that holds this one, from
  /// the pixel that holds the first one on.
  const float* phases = nullptr;
  /// Not null: [x, channel], in place of `phases`.
  const float* whole_row = nullptr;
  /// Not null: [channel], in place of the phase of the last pixel.
  const float* last_pixel = nullptr;
};

/// LeakyReLU of skip + phase, stored: [x, channel].
void combine_phases(const DecoderRow& row, float* stored);
void combine_phases(const DecoderRow& row, Bfloat16* stored);
void combine_phases(const DecoderRow& row, std::uint8_t* stored);

/// ReLU of pixels [pixel, channel] into planes: planes[c * plane_stride + pixel]. NaN stays NaN.
/// Whether all pixels are finite.
bool rectify_into_planes(const float* pixels, std::size_t pixel_count, int channels, float* planes,
                         std::size_t plane_stride);

/// Output rows [first_row, first_row + row_count) of a decoder, and the rows of its phases' kernel
/// (decoder_kernels.h) that hold them.
struct DecoderStrip {
  int first_row = 0;
  int row_count = 0;
  int first_phase_row = 0;
  int phase_row_count = 0;
};

/// Strips that cover `height` ≥ 1 output rows from the first to the last, each of at most
/// `phase_rows` ≥ 1 rows of phases: phase row p holds output rows 2p - 1 and 2p. Pure.
std::vector<DecoderStrip> decoder_strips(int height, int phase_rows);

}  // namespace eventgan
