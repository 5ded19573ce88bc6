#include "stages/frames/sequences/natural_order.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace eventgan {
namespace {

TEST(NaturalLess, OrdersAsPeopleDo) {
  // Each before all that follow it. "0" and "00", "01" and "1" are equal numbers: their bytes
  // decide.
  const std::vector<std::string> ordered = {
      "",  "0",  "00",   "01",    "1",     "2",   "10", "123456789012345678901",
      "a", "a1", "a1b2", "a1b10", "a02b1", "a10", "b",  "\xC3\xA9"};
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    for (std::size_t k = 0; k < ordered.size(); ++k) {
      EXPECT_EQ(natural_less(ordered[i], ordered[k]), i < k) << ordered[i] << " " << ordered[k];
    }
  }
}

}  // namespace
}  // namespace eventgan
