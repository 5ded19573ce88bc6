#include "stages/generator/onednn/decoder_strips.h"

#include <algorithm>

namespace eventgan {

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
