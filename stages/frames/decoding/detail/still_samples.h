#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>

namespace eventgan {

// How a resized photograph's pixels are sampled where they lie in a plane [y, x] int16.

inline constexpr int kSampleFineBits = 10;  // places are summed in 1/1024 px,
inline constexpr int kSamplePartBits = 5;   // and rounded to 1/32, as OpenCV does
inline constexpr int kSampleParts = 1 << kSamplePartBits;
inline constexpr int kSampleTaps = 4;  // pixels of the photograph in a row

inline constexpr int kSampleShareBits = 11;
inline constexpr int kSampleShare = 1 << kSampleShareBits;  // of both pixels of a resized one

inline constexpr int kPlaneLevel = 128;            // of a plane, to a grey level
inline constexpr int kRowLevel = kPlaneLevel / 4;  // of a row: the upper half of a product is kept
inline constexpr int kRowWhite = 255 * kRowLevel;

/// The plane with its border repeated as far as a kernel reaches.
struct SampledPlane {
  explicit SampledPlane(const cv::Mat& plane);

  cv::Mat values;  ///< with its border
  const std::int16_t* first;
  std::ptrdiff_t stride;
  int width;  ///< without it
  int height;
};

/// Weights of the pixels -1, 0, 1, and 2 of a sample at `place` / 32 px, 0 to 31; twice the same.
using SampleKernel = std::array<std::array<std::int16_t, 2 * kSampleTaps>, kSampleParts>;

extern const SampleKernel kCubicSamples;  ///< Keys with a = -0.75
extern const SampleKernel kLinearSamples;

/// Where a row of samples lies: for each of them a part that is its column's, plus what is the
/// row's, in 1/1024 px; and the share of the second column and row in a sample, in 1/2048, in the
/// upper half, that of the first in the lower.
struct SampledPlaces {
  std::span<const int> x, y;
  std::span<const std::int32_t> shares_x;
  int row_x, row_y;
  std::int32_t shares_y;
};

/// A row of samples, kRowLevel to a grey level: each of four places a pixel apart, each of them
/// within black and white, as they are in an image that is resized. Thread safe.
void sample_row(const SampledPlane& plane, const SampleKernel& kernel, const SampledPlaces& places,
                std::span<std::int16_t> row);

/// The same without AVX2.
void sample_row_anywhere(const SampledPlane& plane, const SampleKernel& kernel,
                         const SampledPlaces& places, std::span<std::int16_t> row);

}  // namespace eventgan
