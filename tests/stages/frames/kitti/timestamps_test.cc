#include "stages/frames/kitti/timestamps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::vector<double> parse(const std::string& text) {
  const auto outcome = parse_timestamps(text, "t.txt");
  if (is_fault(outcome)) ADD_FAILURE() << std::get<SampleFault>(outcome).reason;
  return is_fault(outcome) ? std::vector<double>() : std::get<std::vector<double>>(outcome);
}

std::string fault(const std::string& text) {
  const auto outcome = parse_timestamps(text, "t.txt");
  return is_fault(outcome) ? std::get<SampleFault>(outcome).reason : "";
}

TEST(Timestamps, CountsFromTheFirstLine) {
  const auto seconds = parse(
      "2011-09-26 13:02:25.594360375\n"
      "2011-09-26 13:02:25.694360380\r\n"
      "2011-09-26 13:03:26.500000000");
  ASSERT_EQ(seconds.size(), 3u);
  EXPECT_EQ(seconds[0], 0);
  EXPECT_DOUBLE_EQ(seconds[1], 0.100000005);
  EXPECT_DOUBLE_EQ(seconds[2], 60.905639625);  // 61 s on, 0.594360375 - 0.5 back
}

TEST(Timestamps, RunsOnOverMidnightAndNewYear) {
  const auto seconds = parse(
      "2011-12-31 23:59:59.9\n"
      "2012-01-01 00:00:00\n");
  EXPECT_DOUBLE_EQ(seconds.at(1), 0.1);
}

TEST(Timestamps, ABlankLineIsAnUnknownTime) {
  const auto seconds = parse("\n2011-09-26 13:02:25\n\n2011-09-26 13:02:26\n");
  ASSERT_EQ(seconds.size(), 4u);
  EXPECT_TRUE(std::isnan(seconds[0]));
  EXPECT_EQ(seconds[1], 0);
  EXPECT_TRUE(std::isnan(seconds[2]));
  EXPECT_EQ(seconds[3], 1);
}

TEST(Timestamps, AnEmptyFileHasNone) { EXPECT_TRUE(parse("").empty()); }

TEST(Timestamps, AnythingElseIsAFaultThatNamesTheLine) {
  for (const char* line :
       {"yesterday", "2011-09-26", "2011-09-26T13:02:25", "2011-13-26 13:02:25",
        "2011-02-30 13:02:25", "2011-09-26 24:02:25", "2011-09-26 13:02:25.x", "2011-09-26 13:02",
        "2011-09-26 13:02:-5", "26.09.2011 13:02:25", "2011-09-26 13:02:25 UTC",
        // Months and days that are September 26 in eight bits.
        "2011-265-282 13:02:26", "2011-265-26 13:02:26", "2011-09-282 13:02:26",
        "67547-09-26 13:02:26", "2011-9-26 13:02:26", "2011-09-26 13:02:2",
        "2011-09-26 13:02:26."}) {
    EXPECT_THAT(fault(std::string("2011-09-26 13:02:25\n") + line + "\n"),
                AllOf(HasSubstr("expected a time such as "), HasSubstr("in t.txt:2")))
        << line;
  }
}

TEST(Timestamps, ATimeThatIsNotAfterTheOneBeforeIsAFault) {
  EXPECT_EQ(
      fault("2011-09-26 13:02:25.6\n\n2011-09-26 13:02:25.5\n2011-09-26 13:02:26.0\n"),
      "expected a time after '2011-09-26 13:02:25.6', got '2011-09-26 13:02:25.5', in t.txt:3");
  EXPECT_THAT(fault("2011-09-26 13:02:25.6\n2011-09-26 13:02:25.6\n"), HasSubstr("in t.txt:2"));
}

TEST(Timestamps, ALastLineThatIsCutShortIsAFault) {
  const std::string whole =
      "2011-09-26 13:02:25.594360375\n"
      "2011-09-26 13:02:26.694360380";
  EXPECT_EQ(parse(whole).size(), 2u);  // only the line end is missing
  for (std::size_t length = whole.size() - 1; length > whole.size() - 29; --length) {
    EXPECT_THAT(fault(whole.substr(0, length)), HasSubstr("in t.txt:2")) << length;
  }
}

}  // namespace
}  // namespace eventgan
