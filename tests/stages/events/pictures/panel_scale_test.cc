#include "stages/events/pictures/panel_scale.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(PanelScale, WholeFactorsWithinBounds) {
  EXPECT_EQ(panel_scale({260, 861}).factor, 1);
  EXPECT_EQ(panel_scale({260, 346}).factor, 2);  // 692 <= 720 < 1038
  EXPECT_EQ(panel_scale({240, 96}).factor, 3);
  EXPECT_EQ(panel_scale({1, 1}).factor, 8);
  EXPECT_EQ(panel_scale({4000, 4000}).factor, 1);
}

TEST(PanelScale, APixelsCentreStaysInTheMiddleOfItsSquare) {
  const PanelScale scale{4};
  // Volume pixel 3 becomes panel pixels 12..15, with the middle 13.5.
  EXPECT_EQ(scale.point({3, 0}), (Point{13.5, 1.5}));
  // The edge at 3 lies before panel pixel 12.
  EXPECT_EQ(scale.corner(3, 0), (Point{11.5, -0.5}));
}

}  // namespace
}  // namespace eventgan
