#include "pipeline/planning/spread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::ElementsAre;

TEST(Spread, EvenlyFromTheFirst) {
  EXPECT_THAT(spread(3, 9), ElementsAre(0, 3, 6));
  EXPECT_THAT(spread(8, 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(spread(8, 0), ElementsAre());
}

}  // namespace
}  // namespace eventgan
