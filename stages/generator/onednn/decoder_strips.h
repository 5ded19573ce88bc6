#pragma once

#include <vector>

namespace eventgan {

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
