#include "stages/events/drawn_events.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/processor_clones.h"

namespace eventgan {
namespace {

constexpr std::size_t kTogether = 256;  ///< pixels, so that memory is read in its order
constexpr float kMostApart = 64;

/// In which sixteenth of [0, 1) a pixel's phase lies, by its place in a block of 4x4 pixels: each
/// 2x2 of it have one in each quarter (Bayer 1973). It remains so where all sixteen are XORed with
/// the same four bits.
constexpr std::array<std::uint64_t, 16> kSixteenths = {0, 8,  2, 10, 12, 4, 14, 6,
                                                       3, 11, 1, 9,  15, 7, 13, 5};

/// Pixels of one polarity, [bin, pixel] with room for kTogether of each bin.
struct Piece {
  std::size_t bins = 0;
  std::size_t pixels = 0;
  std::array<float, kTogether> phases{};  ///< u
  std::vector<float> rates, sums, counts;

  explicit Piece(std::size_t bin_count)
      : bins(bin_count), rates(bins * kTogether), sums(rates.size()), counts(rates.size()) {}
};

/// counts: how many whole numbers the sum passes in each bin; sums: how far it is beyond the last
/// one when the bin begins, in [0, 1).
EVENTGAN_CLONES
void count_events(Piece& piece) {
  std::array<float, kTogether> sums = piece.phases;
  for (std::size_t first = 0; first < piece.rates.size(); first += kTogether) {
    for (std::size_t i = 0; i < kTogether; ++i) {
      const float sum = sums[i] + piece.rates[first + i];
      piece.sums[first + i] = sums[i];
      piece.counts[first + i] = std::floor(sum);
      sums[i] = sum - piece.counts[first + i];
    }
  }
}

/// Adds the events of a bin to a pixel whose bins lie `plane` apart.
void add_events(std::size_t bin, std::size_t bins, float rate, float sum, float count,
                std::size_t plane, float* pixel) {
  const auto last = static_cast<float>(bins - 1);
  const float begin = std::max(static_cast<float>(bin) - 0.5f, 0.0f);
  const float end = std::min(static_cast<float>(bin) + 0.5f, last);
  if (!(count <= kMostApart)) {
    pixel[bin * plane] += count;
    return;
  }
  for (float event = 1; event <= count; ++event) {
    const float part = std::min((event - sum) / rate, 1.0f);
    const float star = begin + part * (end - begin);
    const auto before = static_cast<std::size_t>(star);
    const float after = star - static_cast<float>(before);
    pixel[before * plane] += 1 - after;
    if (after > 0) pixel[(before + 1) * plane] += after;
  }
}

/// Of pixels from number `first` on; those of their polarity have random numbers from
/// `first_random` on.
EVENTGAN_CLONES
void draw_phases(const CounterRandom& random, std::size_t first_random, std::size_t first,
                 std::size_t width, std::span<float> phases) {
  for (std::size_t done = 0; done < phases.size();) {
    const std::size_t begin = (first + done) % width;
    const std::size_t end = std::min(width, begin + phases.size() - done);
    const std::size_t y = (first + done) / width;
    const std::size_t row_random = first_random + y * width;
    const std::size_t block_random = row_random - y % 4 * width;
    for (std::size_t x = begin; x < end; ++x, ++done) {
      const std::uint64_t sixteenth =
          kSixteenths[y % 4 * 4 + x % 4] ^ (random.bits(block_random + x - x % 4) % 16);
      // 24 bits, of which float32 rounds none up to 1.
      const std::uint64_t bits = sixteenth << 20 | random.bits(row_random + x) >> 44;
      phases[done] = static_cast<float>(static_cast<std::int32_t>(bits)) * 0x1p-24f;
    }
  }
}

/// Of one polarity [bin, y, x]; the pixels' random numbers begin at `first_random`.
void draw_polarity(float* volume, ImageSize size, const CounterRandom& random,
                   std::size_t first_random, Piece& piece) {
  const std::size_t plane = size.pixel_count();
  for (std::size_t first = 0; first < plane; first += kTogether) {
    piece.pixels = std::min(kTogether, plane - first);
    draw_phases(random, first_random, first, static_cast<std::size_t>(size.width),
                std::span(piece.phases).first(piece.pixels));
    for (std::size_t bin = 0; bin < piece.bins; ++bin) {
      float* const values = volume + bin * plane + first;
      std::copy_n(values, piece.pixels, piece.rates.data() + bin * kTogether);
      std::fill_n(values, piece.pixels, 0.0f);
    }
    count_events(piece);
    for (std::size_t bin = 0; bin < piece.bins; ++bin) {
      for (std::size_t i = 0; i < piece.pixels; ++i) {
        const std::size_t at = bin * kTogether + i;
        if (piece.counts[at] == 0) continue;
        add_events(bin, piece.bins, piece.rates[at], piece.sums[at], piece.counts[at], plane,
                   volume + first + i);
      }
    }
  }
}

}  // namespace

void draw_events(std::span<float> volume, const VolumeShape& shape, const CounterRandom& random) {
  if (volume.size() != shape.value_count()) {
    throw std::invalid_argument("expected " + std::to_string(shape.value_count()) +
                                " values of a volume, got " + std::to_string(volume.size()));
  }
  const std::size_t plane = shape.size.pixel_count();
  const auto bins = static_cast<std::size_t>(shape.bins);
  Piece piece(bins);
  draw_polarity(volume.data(), shape.size, random, 0, piece);
  draw_polarity(volume.data() + bins * plane, shape.size, random, plane, piece);
}

}  // namespace eventgan
