#include "stages/events/simulation/linear_intensity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace eventgan {
namespace {

TEST(LinearIntensity, IsTheGreyValueOver255) {
  EXPECT_THAT(linear_intensity({{1, 3}, {0, 51, 255}}), ::testing::ElementsAre(0.0f, 0.2f, 1.0f));
}

TEST(LinearIntensity, RefusesWhatIsNoPicture) {
  EXPECT_THROW(linear_intensity({}), std::invalid_argument);
  EXPECT_THROW(linear_intensity({{0, 4}, {}}), std::invalid_argument);
  EXPECT_THROW(linear_intensity({{2, 2}, {1, 2, 3}}), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
