#include "stages/frames/padded_number.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(PaddedNumber, HasAtLeastTheWidth) {
  EXPECT_EQ(padded_number(0), "000000");
  EXPECT_EQ(padded_number(1497), "001497");
  EXPECT_EQ(padded_number(1234567), "1234567");
  EXPECT_EQ(padded_number(53, 8), "00000053");
  EXPECT_EQ(padded_number(7, 0), "7");
}

}  // namespace
}  // namespace eventgan
