#include "stages/frames/decoding/placed_picture.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace eventgan {
namespace {

ColourFrame plain_frame(ImageSize size, std::uint8_t value) {
  return {size, std::vector<std::uint8_t>(3 * size.pixel_count(), value)};
}

TEST(PlacedPicture, BordersAreBlack) {
  // 2x2 enlarged to 4x4 in the middle of 4x8.
  const Placement placement{{2, 2}, {4, 4}, {4, 8}, /*offset_x=*/2, /*offset_y=*/0};
  const auto placed = place_colour(plain_frame({2, 2}, 200), placement);
  ASSERT_EQ(placed.size(), 3u * 4 * 8);
  for (int x = 0; x < 8; ++x) {
    EXPECT_EQ(placed[3 * (8 * 3 + x)], x >= 2 && x < 6 ? 200 : 0) << "column " << x;
  }
}

TEST(PlacedPicture, CropKeepsTheMiddle) {
  ColourFrame frame = plain_frame({1, 4}, 0);
  for (int x = 0; x < 4; ++x) frame.bgr[3 * x + 1] = static_cast<std::uint8_t>(10 * x);
  const Placement placement{{1, 4}, {1, 4}, {1, 2}, /*offset_x=*/-1, /*offset_y=*/0};
  EXPECT_EQ(place_colour(frame, placement), (std::vector<std::uint8_t>{0, 10, 0, 0, 20, 0}));
}

TEST(PlacedPicture, RefusesAFrameOfAnotherSize) {
  const Placement placement{{2, 2}, {2, 2}, {2, 2}, 0, 0};
  EXPECT_THROW(place_colour(plain_frame({2, 3}, 0), placement), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
