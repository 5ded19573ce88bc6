#include "pipeline/calibration/volume_distance.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>

namespace eventgan {
namespace {

TEST(RelativeDistance, IsTheNormOfTheDifferenceOverTheReferences) {
  constexpr std::array reference{3.0f, 0.0f, 4.0f};
  constexpr std::array volume{3.0f, 1.0f, 4.0f};
  EXPECT_DOUBLE_EQ(relative_distance(volume, reference), 1.0 / 5);
  EXPECT_EQ(relative_distance(reference, reference), 0);
  constexpr std::array nothing{0.0f, 0.0f, 0.0f};
  EXPECT_EQ(relative_distance(nothing, reference), 1);
}

TEST(RelativeDistance, OfAReferenceWithoutEvents) {
  constexpr std::array nothing{0.0f, 0.0f};
  constexpr std::array faint{0.0f, 1e-30f};
  EXPECT_EQ(relative_distance(nothing, nothing), 0);
  EXPECT_EQ(relative_distance(faint, nothing), std::numeric_limits<double>::infinity());
  EXPECT_EQ(relative_distance({}, {}), 0);
}

}  // namespace
}  // namespace eventgan
