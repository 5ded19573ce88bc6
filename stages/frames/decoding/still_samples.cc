#include "stages/frames/decoding/detail/still_samples.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace eventgan {
namespace {

constexpr int kWeightBits = 14;
constexpr int kBefore = 4;  // beyond the border: where all that is seen is the border's pixel
constexpr int kBehind = 8;
// Products, and what follows, are rounded down: by 1/2 at a time, that many times.
constexpr int kRounding = (kSampleTaps + 3) / 2;

constexpr double cubic(double x) {
  x = x < 0 ? -x : x;
  if (x <= 1) return (1.25 * x - 2.25) * x * x + 1;
  return x < 2 ? ((-0.75 * x + 3.75) * x - 6) * x + 3 : 0;
}

constexpr double linear(double x) {
  x = x < 0 ? -x : x;
  return x < 1 ? 1 - x : 0;
}

template <class Function>
SampleKernel make_kernel(Function function) {
  SampleKernel kernel{};
  for (int place = 0; place < kSampleParts; ++place) {
    auto& weights = kernel[static_cast<std::size_t>(place)];
    int sum = 0;
    for (int k = 0; k < kSampleTaps; ++k) {
      const double weight = function(k - 1 - double(place) / kSampleParts);
      weights[static_cast<std::size_t>(k)] =
          static_cast<std::int16_t>(std::lround((1 << kWeightBits) * weight));
      sum += weights[static_cast<std::size_t>(k)];
    }
    *std::ranges::max_element(weights) += static_cast<std::int16_t>((1 << kWeightBits) - sum);
    std::copy_n(weights.begin(), kSampleTaps, weights.begin() + kSampleTaps);
  }
  return kernel;
}

/// Some of a row's samples.
struct Block {
  static constexpr std::size_t kMost = 64;

  std::size_t count;
  std::array<int, kMost> from;              ///< of the plane's pixels, where the first tap lies
  std::array<int, kMost> right, down;       ///< of the place, in 1/32 px
  std::array<std::int32_t, kMost> columns;  ///< what is seen in both, the second in the upper half
};

inline __attribute__((always_inline)) void find_places(const SampledPlane& plane,
                                                       const SampledPlaces& places,
                                                       std::size_t first, Block& block) {
  constexpr int kShift = kSampleFineBits - kSamplePartBits, kRound = 1 << (kShift - 1);
  const int stride = static_cast<int>(plane.stride);
  for (std::size_t i = 0; i < block.count; ++i) {
    const int x = std::clamp((places.row_x + places.x[first + i] + kRound) >> kShift,
                             -3 * kSampleParts, (plane.width + 1) * kSampleParts);
    const int y = std::clamp((places.row_y + places.y[first + i] + kRound) >> kShift,
                             -3 * kSampleParts, (plane.height + 1) * kSampleParts);
    block.from[i] = ((y >> kSamplePartBits) - 1) * stride + (x >> kSamplePartBits) - 1;
    block.right[i] = x & (kSampleParts - 1);
    block.down[i] = y & (kSampleParts - 1);
  }
}

inline __attribute__((always_inline)) void join_columns(const Block& block,
                                                        std::span<const std::int32_t> shares,
                                                        std::int16_t* row) {
  const auto lower = [](std::int32_t both) { return static_cast<std::int16_t>(both); };
  for (std::size_t i = 0; i < block.count; ++i) {
    const int sum =
        lower(block.columns[i]) * lower(shares[i]) + (block.columns[i] >> 16) * (shares[i] >> 16);
    row[i] = static_cast<std::int16_t>(sum >> kSampleShareBits);
  }
}

inline __attribute__((always_inline)) void sample(const SampledPlane& plane,
                                                  const SampleKernel& kernel,
                                                  std::int32_t shares_of_rows, Block& block) {
  const cv::v_int16x8 shares_y = cv::v_reinterpret_as_s16(cv::v_setall_s32(shares_of_rows));
  const cv::v_int16x8 white = cv::v_setall_s16(kRowWhite);
  for (std::size_t i = 0; i < block.count; ++i) {
    const std::int16_t* from = plane.first + block.from[i];
    const auto& down = kernel[static_cast<std::size_t>(block.down[i])];
    const auto row_of = [&](int j) { return cv::v_load(from + j * plane.stride); };
    cv::v_int16x8 upper = cv::v_setall_s16(kRounding), lower = upper, next = row_of(0);
    for (int j = 0; j < kSampleTaps; ++j) {
      const cv::v_int16x8 weight = cv::v_setall_s16(down[static_cast<std::size_t>(j)]);
      upper += cv::v_mul_hi(next, weight);
      next = row_of(j + 1);
      lower += cv::v_mul_hi(next, weight);
    }
    const cv::v_int16x8 along = cv::v_load(kernel[static_cast<std::size_t>(block.right[i])].data());
    const auto both = [&](const cv::v_int16x8& column) {  // from its first pixel, and its second
      return cv::v_dotprod(cv::v_combine_low(column, cv::v_rotate_right<1>(column)), along);
    };
    cv::v_int32x4 left, right;
    cv::v_zip(both(upper), both(lower), left, right);
    const cv::v_int32x4 four =
        (cv::v_combine_low(left, right) + cv::v_combine_high(left, right)) >> kWeightBits;
    const cv::v_int16x8 seen =
        cv::v_min(cv::v_max(cv::v_pack(four, four), cv::v_setzero_s16()), white);
    const cv::v_int32x4 two = cv::v_dotprod(seen, shares_y) >> kSampleShareBits;
    block.columns[i] = cv::v_reinterpret_as_s32(cv::v_pack(two, two)).get0();
  }
}

#if defined(__x86_64__)

#define EVENTGAN_AVX2 __attribute__((target("avx2")))
#define EVENTGAN_AVX2_INLINE EVENTGAN_AVX2 __attribute__((always_inline)) inline

EVENTGAN_AVX2_INLINE __m256i load_both(const std::int16_t* first, const std::int16_t* second) {
  const __m128i lower = _mm_loadu_si128(reinterpret_cast<const __m128i*>(first));
  const __m128i upper = _mm_loadu_si128(reinterpret_cast<const __m128i*>(second));
  return _mm256_inserti128_si256(_mm256_castsi128_si256(lower), upper, 1);
}

/// What is seen in a column, from its first pixel and from its second; two sums of each.
EVENTGAN_AVX2_INLINE __m256i weigh(__m256i column, __m256i along) {
  const __m256i next = _mm256_bsrli_epi128(column, 2);
  return _mm256_madd_epi16(_mm256_unpacklo_epi64(column, next), along);
}

/// As `sample`, two at a time.
EVENTGAN_AVX2 void sample_by_two(const SampledPlane& plane, const SampleKernel& kernel,
                                 std::int32_t shares_of_rows, Block& block) {
  const __m256i shares_y = _mm256_set1_epi32(shares_of_rows);
  const __m256i white = _mm256_set1_epi16(kRowWhite), black = _mm256_setzero_si256();
  const std::int16_t* weights = kernel[0].data();
  for (std::size_t i = 0; i < block.count; i += 2) {
    const std::size_t other = std::min(i + 1, block.count - 1);
    const std::int16_t* first = plane.first + block.from[i];
    const std::int16_t* second = plane.first + block.from[other];
    const __m256i down = load_both(weights + 8 * block.down[i], weights + 8 * block.down[other]);
    const __m256i along = load_both(weights + 8 * block.right[i], weights + 8 * block.right[other]);
    __m256i upper = _mm256_set1_epi16(kRounding), lower = upper, next = load_both(first, second);
    for (int j = 0; j < kSampleTaps; ++j) {
      first += plane.stride;
      second += plane.stride;
      const auto bytes = static_cast<std::int16_t>(0x0100 + 0x0202 * j);
      const __m256i weight = _mm256_shuffle_epi8(down, _mm256_set1_epi16(bytes));
      upper = _mm256_add_epi16(upper, _mm256_mulhi_epi16(next, weight));
      next = load_both(first, second);
      lower = _mm256_add_epi16(lower, _mm256_mulhi_epi16(next, weight));
    }
    const __m256i above = weigh(upper, along), below = weigh(lower, along);
    const __m256i left = _mm256_unpacklo_epi32(above, below);
    const __m256i right = _mm256_unpackhi_epi32(above, below);
    const __m256i four = _mm256_srai_epi32(
        _mm256_add_epi32(_mm256_unpacklo_epi64(left, right), _mm256_unpackhi_epi64(left, right)),
        kWeightBits);
    const __m256i seen =
        _mm256_min_epi16(_mm256_max_epi16(_mm256_packs_epi32(four, four), black), white);
    const __m256i two = _mm256_srai_epi32(_mm256_madd_epi16(seen, shares_y), kSampleShareBits);
    const __m256i columns = _mm256_packs_epi32(two, two);
    block.columns[i] = _mm_cvtsi128_si32(_mm256_castsi256_si128(columns));
    block.columns[other] =
        i == other ? block.columns[i] : _mm_cvtsi128_si32(_mm256_extracti128_si256(columns, 1));
  }
}

#endif

/// `sample_block`: of a Block.
template <class Sample>
inline __attribute__((always_inline)) void sample_in_blocks(const SampledPlane& plane,
                                                            const SampledPlaces& places,
                                                            std::span<std::int16_t> row,
                                                            Sample sample_block) {
  Block block;
  for (std::size_t first = 0; first < row.size(); first += Block::kMost) {
    block.count = std::min(row.size() - first, Block::kMost);
    find_places(plane, places, first, block);
    sample_block(block);
    join_columns(block, places.shares_x.subspan(first, block.count), row.data() + first);
  }
}

#if defined(__x86_64__)

EVENTGAN_AVX2 void sample_with_avx2(const SampledPlane& plane, const SampleKernel& kernel,
                                    const SampledPlaces& places, std::span<std::int16_t> row) {
  sample_in_blocks(plane, places, row,
                   [&](Block& block) { sample_by_two(plane, kernel, places.shares_y, block); });
}

#endif

}  // namespace

const SampleKernel kCubicSamples = make_kernel(cubic);
const SampleKernel kLinearSamples = make_kernel(linear);

SampledPlane::SampledPlane(const cv::Mat& plane) : width(plane.cols), height(plane.rows) {
  cv::copyMakeBorder(plane, values, kBefore, kBehind, kBefore, kBehind, cv::BORDER_REPLICATE);
  first = values.ptr<std::int16_t>(kBefore) + kBefore;
  stride = static_cast<std::ptrdiff_t>(values.step1());
}

void sample_row_anywhere(const SampledPlane& plane, const SampleKernel& kernel,
                         const SampledPlaces& places, std::span<std::int16_t> row) {
  sample_in_blocks(plane, places, row,
                   [&](Block& block) { sample(plane, kernel, places.shares_y, block); });
}

void sample_row(const SampledPlane& plane, const SampleKernel& kernel, const SampledPlaces& places,
                std::span<std::int16_t> row) {
#if defined(__x86_64__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  if (has_avx2) return sample_with_avx2(plane, kernel, places, row);
#endif
  sample_row_anywhere(plane, kernel, places, row);
}

}  // namespace eventgan
