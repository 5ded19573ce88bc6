#include "manifests/values/text_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::string_view> bytes_of(std::string_view text) {
  std::vector<std::string_view> bytes;
  int number = 0;
  for (const TextLine& line : split_lines(text)) {
    EXPECT_EQ(line.number, ++number);
    bytes.push_back(line.bytes);
  }
  return bytes;
}

TEST(SplitLines, KeepsEveryByte) {
  EXPECT_THAT(bytes_of(""), IsEmpty());
  EXPECT_THAT(bytes_of("a b"), ElementsAre("a b"));
  EXPECT_THAT(bytes_of("a\n"), ElementsAre("a\n"));
  EXPECT_THAT(bytes_of("a\r\n\n\nb"), ElementsAre("a\r\n", "\n", "\n", "b"));
}

TEST(SplitLines, ByteOrderMarksAreNoPartOfThem) {
  const auto lines = split_lines(
      "\xEF\xBB\xBF"
      "a\n\xEF\xBB\xBF");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].bytes, "a\n");
  EXPECT_EQ(lines[1].bytes, "\xEF\xBB\xBF");
  EXPECT_TRUE(split_lines("\xEF\xBB\xBF").empty());
}

TEST(SplitColumns, SeparatesAtSpacesTabsAndLineEnds) {
  EXPECT_THAT(split_columns("  a\tb   c \r\n"), ElementsAre("a", "b", "c"));
  EXPECT_THAT(split_columns("a"), ElementsAre("a"));
  EXPECT_THAT(split_columns(" \r\n"), IsEmpty());
  EXPECT_THAT(split_columns(""), IsEmpty());
}

TEST(ParseNumber, TakesTheWholeTokenOnly) {
  EXPECT_EQ(parse_number<double>("-1.50"), -1.5);
  EXPECT_EQ(parse_number<double>("7.2e+02"), 720.0);
  EXPECT_EQ(parse_number<int>("0012"), 12);
  for (const char* token : {"", "1.5x", "x", "1,5", "+1", " 1", "nan", "inf", "-inf", "1e999"}) {
    EXPECT_FALSE(parse_number<double>(token)) << token;
  }
  for (const char* token : {"", "1.0", "99999999999", "1 "}) {
    EXPECT_FALSE(parse_number<int>(token)) << token;
  }
}

TEST(ParseNumber, RefusesWhatAFloatCannotHold) {
  EXPECT_FALSE(parse_number<float>("1e300"));
  EXPECT_TRUE(parse_number<double>("1e300"));
}

TEST(ParseWhole, TakesTheDecimalsThatToolsWrite) {
  for (const char* token : {"2", "2.0", "2.", "2e0", "0.2e1", "02.000"}) {
    EXPECT_EQ(parse_whole(token), 2) << token;
  }
  EXPECT_EQ(parse_whole("-1.0"), -1);
  EXPECT_EQ(parse_whole("9223372036854775807"), 9223372036854775807);
  EXPECT_EQ(parse_whole("9007199254740992.0"), 9007199254740992);
  for (const char* token : {"", "2.5", "2,0", "2.0x", " 2", "nan", "inf", "1e16", "1e400"}) {
    EXPECT_FALSE(parse_whole(token)) << token;
  }
}

TEST(ParseNumber, WhatIsTooSmallIsZero) {
  EXPECT_EQ(parse_number<float>("1e-50"), 0.0f);
  EXPECT_EQ(parse_number<float>("1e-400"), 0.0f);
  EXPECT_EQ(parse_number<double>("1e-50"), 1e-50);
  EXPECT_EQ(parse_number<double>("-1e-400"), 0.0);
  EXPECT_EQ(parse_number<double>("0." + std::string(400, '0') + "1"), 0.0);
  EXPECT_FALSE(parse_number<double>("1e-400x"));
  EXPECT_FALSE(parse_number<double>("1" + std::string(400, '0')));
}

TEST(ShellWord, IsQuotedWhereAShellWouldSplitIt) {
  EXPECT_EQ(shell_word("out/job_1.json"), "out/job_1.json");
  EXPECT_EQ(shell_word("my photos/job.json"), "'my photos/job.json'");
  EXPECT_EQ(shell_word("Jo's $HOME"), "'Jo'\\''s $HOME'");
  EXPECT_EQ(shell_word(""), "''");
}

TEST(InQuotes, ShowsForeignBytesAsOneLineOfPlainText) {
  EXPECT_EQ(in_quotes("Car"), "'Car'");
  EXPECT_EQ(in_quotes(std::string_view("a\0\xff\nb", 5)), "'a???b'");
  EXPECT_EQ(in_quotes(std::string(41, 'x')), "'" + std::string(40, 'x') + "...'");
}

}  // namespace
}  // namespace eventgan
