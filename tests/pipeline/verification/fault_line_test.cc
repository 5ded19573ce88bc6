#include "pipeline/verification/fault_line.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace eventgan {
namespace {

TEST(FaultLine, IsOneLineHoweverDeepTheCause) {
  EXPECT_EQ(fault_line(std::runtime_error("cannot read x")), "cannot read x");
  EXPECT_EQ(fault_line(std::runtime_error("two faults:\n  first\n  second\n")),
            "two faults:: first: second");
  try {
    try {
      throw std::runtime_error("no such file");
    } catch (const std::runtime_error&) {
      std::throw_with_nested(std::runtime_error("cannot read x"));
    }
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(fault_line(error), "cannot read x: because: no such file");
  }
}

}  // namespace
}  // namespace eventgan
