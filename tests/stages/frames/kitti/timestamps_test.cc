#include "stages/frames/kitti/timestamps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "manifests/faults.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;

TEST(Timestamps, CountsFromTheFirstLine) {
  const auto seconds = parse_timestamps(
      "2011-09-26 13:02:25.594360375\n"
      "2011-09-26 13:02:25.694360380\r\n"
      "2011-09-26 13:03:26.5",
      "t.txt");
  ASSERT_EQ(seconds.size(), 3u);
  EXPECT_EQ(seconds[0], 0);
  EXPECT_DOUBLE_EQ(seconds[1], 0.100000005);
  EXPECT_DOUBLE_EQ(seconds[2], 60.905639625);  // 61 s on, 0.594360375 - 0.5 back
}

TEST(Timestamps, RunsOnOverMidnightAndNewYear) {
  const auto seconds = parse_timestamps(
      "2011-12-31 23:59:59.9\n"
      "2012-01-01 00:00:00\n",
      "t.txt");
  EXPECT_DOUBLE_EQ(seconds.at(1), 0.1);
}

TEST(Timestamps, ABlankLineIsAnUnknownTime) {
  const auto seconds = parse_timestamps("\n2011-09-26 13:02:25\n\n2011-09-26 13:02:26\n", "t.txt");
  ASSERT_EQ(seconds.size(), 4u);
  EXPECT_TRUE(std::isnan(seconds[0]));
  EXPECT_EQ(seconds[1], 0);
  EXPECT_TRUE(std::isnan(seconds[2]));
  EXPECT_EQ(seconds[3], 1);
}

TEST(Timestamps, AnEmptyFileHasNone) { EXPECT_TRUE(parse_timestamps("", "t.txt").empty()); }

TEST(Timestamps, AnythingElseIsAnErrorThatNamesTheLine) {
  for (const char* line :
       {"yesterday", "2011-09-26", "2011-09-26T13:02:25", "2011-13-26 13:02:25",
        "2011-02-30 13:02:25", "2011-09-26 24:02:25", "2011-09-26 13:02:25.x", "2011-09-26 13:02",
        "2011-09-26 13:02:-5", "26.09.2011 13:02:25", "2011-09-26 13:02:25 UTC"}) {
    try {
      parse_timestamps(std::string("2011-09-26 13:02:25\n") + line, "t.txt");
      FAIL() << line;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("t.txt:2"));
    }
  }
}

}  // namespace
}  // namespace eventgan
