#include "stages/frames/decoding/visible_part.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(VisiblePart, StretchIsTheWholeVolume) {
  const VisiblePart part = visible_part({{10, 20}, {5, 7}, {5, 7}, 0, 0});
  EXPECT_EQ(part.size, (ImageSize{5, 7}));
  EXPECT_EQ(part.volume_x + part.volume_y + part.scaled_x + part.scaled_y, 0);
}

TEST(VisiblePart, LetterboxIsTheWholePicture) {
  const VisiblePart part = visible_part({{10, 20}, {5, 10}, {9, 10}, 0, 2});
  EXPECT_EQ(part.size, (ImageSize{5, 10}));
  EXPECT_EQ(part.volume_y, 2);
  EXPECT_EQ(part.scaled_y, 0);
}

TEST(VisiblePart, CropIsTheWholeVolumeCutFromTheMiddle) {
  // floor((5 - 10) / 2) = -3: three columns are cut on the left, two on the right.
  const VisiblePart part = visible_part({{10, 20}, {5, 10}, {5, 5}, -3, 0});
  EXPECT_EQ(part.size, (ImageSize{5, 5}));
  EXPECT_EQ(part.scaled_x, 3);
  EXPECT_EQ(part.volume_x, 0);
}

}  // namespace
}  // namespace eventgan
