#include "pipeline/profile/trace_text.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

TEST(TraceString, IsAJsonStringOfTheText) {
  for (const std::string text : {"", "plain", "a\"b\\c\n\t\x01", "Zürich 東京"}) {
    EXPECT_EQ(nlohmann::json::parse(trace_string(text)), text);
  }
  EXPECT_EQ(nlohmann::json::parse(trace_string("\xff")), "\xEF\xBF\xBD");
}

TEST(TraceMicroseconds, LosesNothing) {
  EXPECT_EQ(trace_microseconds(0), "0.000");
  EXPECT_EQ(trace_microseconds(7), "0.007");
  EXPECT_EQ(trace_microseconds(1'234'567), "1234.567");
  EXPECT_EQ(trace_microseconds(std::numeric_limits<std::int64_t>::max()), "9223372036854775.807");
}

}  // namespace
}  // namespace eventgan
