#include "stages/generator/onednn/detail/tiled_layers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace eventgan {
namespace {

TileMask tiles(ImageSize size, int first_row, int last_row, int first_column, int last_column) {
  TileMask mask{size, 16, 0, 0, {}};
  mask.wanted.resize(static_cast<std::size_t>(mask.rows()) * mask.columns());
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      mask.wanted[static_cast<std::size_t>(row) * mask.columns() + column] = 1;
    }
  }
  return mask;
}

/// Rows and columns that a list of pixels spans, and whether it has all pixels there.
std::array<int, 4> rectangle(const std::vector<int>& pixels, int width) {
  std::array<int, 4> sides{pixels[0] / width, pixels[0] / width, width, 0};
  for (const int pixel : pixels) {
    sides[1] = std::max(sides[1], pixel / width);
    sides[2] = std::min(sides[2], pixel % width);
    sides[3] = std::max(sides[3], pixel % width);
  }
  EXPECT_EQ(pixels.size(),
            static_cast<std::size_t>((sides[1] - sides[0] + 1) * (sides[3] - sides[2] + 1)));
  return sides;
}

TEST(TiledWork, GoesBackThroughTheNetwork) {
  // Tile (10, 20) of 480 x 640: rows 160 to 175, which read rows 79 to 88 of the last decoder's
  // small image, 39 to 44, 19 to 22, and 9 to 11 of the bottleneck's 30; columns 320 to 335 read
  // 159 to 168, 79 to 84, 39 to 42, and 19 to 21 of its 40.
  const TiledWork work = tiled_work(tiles({480, 640}, 10, 10, 20, 20));
  // The last residual convolution, and one pixel more for each before it.
  EXPECT_EQ(rectangle(work.bottleneck[4], 40), (std::array{9, 11, 19, 21}));
  EXPECT_EQ(rectangle(work.bottleneck[3], 40), (std::array{8, 12, 18, 22}));
  EXPECT_EQ(rectangle(work.bottleneck[0], 40), (std::array{5, 15, 15, 25}));
  // The first decoder's phases of rows 19 to 22 and columns 39 to 42 are 10 and 11, 20 and 21.
  EXPECT_EQ(rectangle(work.first_decoder, 41), (std::array{10, 11, 20, 21}));
  // The last one's tiles are 16 rows from -1 on and 32 columns: rows 159 to 174 and 175; columns
  // 319 to 350.
  const auto& last = work.decoders.back();
  ASSERT_EQ(last.size(), 2u);
  EXPECT_EQ(last[0].row, 80);
  EXPECT_EQ(last[0].column, 160);
  EXPECT_EQ(last[1].row, 88);
  EXPECT_LT(work.share, 0.15);
}

TEST(TiledWork, EndsAtTheImageAndOfAWholeOneIsMoreThanItsOwn) {
  const TiledWork work = tiled_work(tiles({33, 17}, 0, 2, 0, 1));
  EXPECT_EQ(rectangle(work.bottleneck[0], 2), (std::array{0, 2, 0, 1}));
  EXPECT_EQ(rectangle(work.bottleneck[4], 2), (std::array{0, 2, 0, 1}));
  EXPECT_GT(work.share, 1);
  // Whole tiles, each with its surroundings, of all layers.
  EXPECT_GT(tiled_work(tiles({320, 480}, 0, 19, 0, 29)).share, 1);
}

TEST(WinogradWork, IsOfTheSamePixelsByTilesOfTwoByTwo) {
  // As above; of the bottleneck's 15 x 20 tiles, and the last decoder's 241 x 321.
  const WinogradWork work = winograd_work(tiles({480, 640}, 10, 10, 20, 20));
  EXPECT_EQ(rectangle(work.residuals[3], 20), (std::array{4, 5, 9, 10}));
  EXPECT_EQ(rectangle(work.residuals[0], 20), (std::array{3, 7, 8, 12}));
  EXPECT_EQ(rectangle(work.encoders[3], 20), (std::array{2, 7, 7, 12}));
  EXPECT_EQ(rectangle(work.decoders[0], 41), (std::array{10, 11, 20, 21}));
  EXPECT_EQ(rectangle(work.decoders[3], 321), (std::array{80, 88, 160, 168}));
  EXPECT_LT(work.share, 0.15);
  EXPECT_NEAR(winograd_work(tiles({320, 480}, 0, 19, 0, 29)).share, 1, 1e-9);
}

}  // namespace
}  // namespace eventgan
