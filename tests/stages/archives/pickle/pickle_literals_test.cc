#include <gtest/gtest.h>

#include <cmath>

#include "stages/archives/pickle/pickle_literals_internal.h"

namespace eventgan {
namespace {

using namespace std::string_literals;

TEST(PickleLiteralsTest, Integers) {
  EXPECT_EQ(parse_pickle_integer("0"), 0);
  EXPECT_EQ(parse_pickle_integer("-9223372036854775808"), INT64_MIN);
  EXPECT_EQ(parse_pickle_integer("12L"), 12);
  for (const char* bad : {"", "L", "-", "1.5", "0x10", " 1", "1 ", "12LL", "9223372036854775808"}) {
    EXPECT_EQ(parse_pickle_integer(bad), std::nullopt) << bad;
  }
}

TEST(PickleLiteralsTest, Floats) {
  EXPECT_EQ(parse_pickle_float("1e-3"), 1e-3);
  EXPECT_EQ(parse_pickle_float("0.1"), 0.1);
  EXPECT_EQ(parse_pickle_float("inf"), INFINITY);
  EXPECT_TRUE(std::isnan(parse_pickle_float("nan").value()));
  for (const char* bad : {"", "1,5", "one", "1.5x"}) {
    EXPECT_EQ(parse_pickle_float(bad), std::nullopt) << bad;
  }
}

TEST(PickleLiteralsTest, ByteStrings) {
  EXPECT_EQ(parse_pickle_string("''"), "");
  EXPECT_EQ(parse_pickle_string("\"it's\""), "it's");
  EXPECT_EQ(parse_pickle_string(R"('a\'b\\c\n\t\x00\xfF')"), "a'b\\c\n\t\x00\xff"s);
  for (const char* bad : {"", "'", "'x", "x'", "'x\"", "'\\'", "'\\x1'", "'\\xg0'", "'\\q'"}) {
    EXPECT_EQ(parse_pickle_string(bad), std::nullopt) << bad;
  }
}

TEST(PickleLiteralsTest, UnicodeStrings) {
  EXPECT_EQ(parse_pickle_unicode(""), "");
  EXPECT_EQ(parse_pickle_unicode("plain \\n stays"), "plain \\n stays");
  EXPECT_EQ(parse_pickle_unicode("\xe9"), "\xc3\xa9");                 // Latin-1 e acute
  EXPECT_EQ(parse_pickle_unicode("\\u20ac!"), "\xe2\x82\xac!");        // euro sign
  EXPECT_EQ(parse_pickle_unicode("\\U0001F600"), "\xf0\x9f\x98\x80");  // grinning face
  for (const char* bad : {"\\u12", "\\u12g4", "\\U0001F60", "\\ud800", "\\U00110000"}) {
    EXPECT_EQ(parse_pickle_unicode(bad), std::nullopt) << bad;
  }
}

}  // namespace
}  // namespace eventgan
