#include "stages/frames/sequences/lower_extension.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(LowerExtension, IsTheLastOneInSmallLetters) {
  EXPECT_EQ(lower_extension("x.Y/a.b.JSON"), ".json");
  EXPECT_EQ(lower_extension("a.mp4"), ".mp4");
  EXPECT_EQ(lower_extension("x.JSON/a"), "");
  EXPECT_EQ(lower_extension(""), "");
}

}  // namespace
}  // namespace eventgan
