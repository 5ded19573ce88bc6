#include <gtest/gtest.h>

#include "stages/archives/utf8_internal.h"

namespace eventgan {
namespace {

using namespace std::string_literals;

TEST(Utf8Test, EncodesTheEdgesOfEveryLength) {
  // First and last code point of each length, from the table of RFC 3629.
  const std::pair<char32_t, std::string> cases[] = {
      {0, "\x00"s},
      {0x7f, "\x7f"},
      {0x80, "\xc2\x80"},
      {0x7ff, "\xdf\xbf"},
      {0x800, "\xe0\xa0\x80"},
      {0xd7ff, "\xed\x9f\xbf"},
      {0xe000, "\xee\x80\x80"},
      {0xffff, "\xef\xbf\xbf"},
      {0x10000, "\xf0\x90\x80\x80"},
      {0x10ffff, "\xf4\x8f\xbf\xbf"},
  };
  for (const auto& [code, expected] : cases) {
    std::string text = "x";
    EXPECT_TRUE(append_utf8(code, text));
    EXPECT_EQ(text, "x" + expected);
    EXPECT_TRUE(is_utf8(text));
  }
}

TEST(Utf8Test, RefusesWhatIsNoCodePoint) {
  for (const char32_t code : {0xd800, 0xdfff, 0x110000}) {
    std::string text;
    EXPECT_FALSE(append_utf8(code, text));
    EXPECT_EQ(text, "");
  }
}

TEST(Utf8Test, RefusesMalformedText) {
  EXPECT_TRUE(is_utf8(""));
  for (const std::string& bad : {"\x80"s, "\xc3"s, "\xc3("s, "\xe2\x82"s, "\xff"s,
                                 "\xc0\x80"s,          // overlong zero
                                 "\xe0\x80\xaf"s,      // overlong slash
                                 "\xed\xa0\x80"s,      // surrogate
                                 "\xf4\x90\x80\x80"s,  // beyond U+10FFFF
                                 "\xf8\x88\x80\x80\x80"s}) {
    EXPECT_FALSE(is_utf8(bad)) << ::testing::PrintToString(bad);
  }
}

}  // namespace
}  // namespace eventgan
