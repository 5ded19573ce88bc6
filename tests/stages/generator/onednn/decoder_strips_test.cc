#include "stages/generator/onednn/decoder_strips.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(DecoderStrips, HoldEveryRowOnceWithItsPhases) {
  for (int height = 1; height <= 23; ++height) {
    for (int phase_rows = 1; phase_rows <= 7; ++phase_rows) {
      int next_row = 0;
      for (const DecoderStrip& strip : decoder_strips(height, phase_rows)) {
        EXPECT_EQ(strip.first_row, next_row);
        EXPECT_GE(strip.row_count, 1);
        EXPECT_LE(strip.phase_row_count, phase_rows);
        for (int y = strip.first_row; y < strip.first_row + strip.row_count; ++y) {
          const int phase_row = (y + 1) / 2;
          EXPECT_GE(phase_row, strip.first_phase_row);
          EXPECT_LT(phase_row, strip.first_phase_row + strip.phase_row_count);
        }
        next_row += strip.row_count;
      }
      EXPECT_EQ(next_row, height) << phase_rows;
    }
  }
}

}  // namespace
}  // namespace eventgan
