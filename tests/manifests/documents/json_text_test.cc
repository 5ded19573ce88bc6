#include "manifests/documents/json_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace eventgan {
namespace {

using ::testing::StartsWith;

TEST(JsonPath, PlainKeysFollowADot) {
  EXPECT_EQ(json_path("$", "max_count"), "$.max_count");
  EXPECT_EQ(json_path("$.a", "B2"), "$.a.B2");
}

TEST(JsonPath, OddKeysAreQuotedInAscii) {
  EXPECT_EQ(json_path("$", ""), R"($[""])");
  EXPECT_EQ(json_path("$", "a b"), R"($["a b"])");
  EXPECT_EQ(json_path("$", "a\"]\n"), R"($["a\"]\n"])");
  EXPECT_EQ(json_path("$", "\xc3\xa9"), R"($["\u00e9"])");
}

TEST(JsonPath, ElementsHaveBrackets) { EXPECT_EQ(json_path("$.a", std::size_t{12}), "$.a[12]"); }

TEST(EscapeControls, LeavesNoControlCharactersAndNoBrokenText) {
  using namespace std::string_literals;
  EXPECT_EQ(escape_controls("naïve — 自転車 \"a\\b\""), "naïve — 自転車 \"a\\b\"");
  EXPECT_EQ(escape_controls("a\0b\r\n\t"s), "a\\u0000b\\u000d\\n\\t");
  EXPECT_EQ(escape_controls("\x1b[31m\x7f"), "\\u001b[31m\\u007f");
  EXPECT_EQ(escape_controls("\xc2\x9b"
                            "1A\xc2\xa0z"),
            "\\u009b1A\xc2\xa0z")
      << "C1 is a terminal's, too";
  EXPECT_EQ(escape_controls("\x9b"
                            "1A\xff\xc3"),
            "\\x9b1A\\xff\\xc3");
  EXPECT_EQ(escape_controls(""), "");
}

TEST(FaultList, IsEmptyAtFirst) {
  const FaultList faults("m");
  EXPECT_TRUE(faults.empty());
  EXPECT_EQ(faults.text(), "");
}

TEST(FaultList, KeepsTheOrder) {
  FaultList faults("m");
  faults.add("$.b", "1", "2");
  faults.add("$.a", "x", "y");
  EXPECT_FALSE(faults.empty());
  EXPECT_EQ(faults.text(), "m: $.b: expected 1, got 2\nm: $.a: expected x, got y");
}

TEST(FaultList, CountsLinesAndCharactersFrom1) {
  const std::string text = "a\n\xc3\xa9z\n";  // line 2: é in two bytes (2, 3), then z
  const auto place = [&](std::size_t byte) {
    FaultList faults("m");
    faults.add_at(text, byte, "x", "y");
    return faults.text();
  };
  EXPECT_EQ(place(0), "m:1:1: expected x, got y");
  EXPECT_EQ(place(1), "m:1:2: expected x, got y");
  EXPECT_EQ(place(2), "m:2:1: expected x, got y");
  EXPECT_EQ(place(4), "m:2:2: expected x, got y");
  EXPECT_EQ(place(6), "m:3:1: expected x, got y");
  EXPECT_EQ(place(99), "m:3:1: expected x, got y");  // beyond the end is the end
}

TEST(FaultList, BeyondAThousandOnlyCounts) {
  FaultList faults("m");
  for (int i = 0; i < 1003; ++i) faults.add("$", "x", std::to_string(i));
  const std::string text = faults.text();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1000);
  EXPECT_TRUE(text.ends_with("m: $: expected x, got 999\nm: and 3 more faults"));
}

/// The document's faults; a document must be there exactly if `has_document`.
std::string text_faults(const std::string& text, bool has_document = false) {
  FaultList faults("t");
  EXPECT_EQ(parse_json_text(text, faults).has_value(), has_document);
  return faults.text();
}

std::string nested(int levels) { return std::string(levels, '[') + std::string(levels, ']'); }

TEST(JsonText, GivesTheDocumentThatNlohmannGives) {
  const std::string text =
      R"({"a": [1, -2, 2.5, 1e3, 18446744073709551615, "x\u00e9\n", true, false, null, {}, []],
          "b": {"c": {"d": [[1], [2, [3]]]}}, "": 0})";
  FaultList faults("t");
  const auto document = parse_json_text(text, faults);
  ASSERT_TRUE(document.has_value()) << faults.text();
  EXPECT_EQ(*document, nlohmann::json::parse(text));
}

TEST(JsonText, AllowsComments) {
  FaultList faults("t");
  const auto document = parse_json_text("// one\n{\"a\": /* two */ \"// kept\"}// end", faults);
  ASSERT_TRUE(document.has_value()) << faults.text();
  EXPECT_EQ(*document, nlohmann::json({{"a", "// kept"}}));
}

TEST(JsonText, SyntaxErrorsHaveLineAndColumn) {
  // The position is where the reader stopped: at the last byte it took, or at the end.
  const std::vector<std::pair<std::string, std::string>> table = {
      {"", "t:1:1: "},
      {"   ", "t:1:4: "},
      {"{\n  \"a\": 1,\n  b\n}", "t:3:3: "},
      {"{\n\"a\": 1\n", "t:3:1: "},
      {"{\"a\": 1,}", "t:1:9: "},
      {"[1 2]", "t:1:4: "},
      {"{} {}", "t:1:4: "},
      {"[NaN]", "t:1:2: "},
      {"[\"\xc3\xa9\", x]", "t:1:7: "},  // é is one character
      {"[01]", "t:1:3: "},
      {"[\"a\nb\"]", "t:1:4: "},
      {"/* open", "t:1:8: "},
  };
  for (const auto& [text, place] : table) {
    EXPECT_THAT(text_faults(text), StartsWith(place + "expected JSON, got an error while parsing"))
        << text;
  }
}

TEST(JsonText, SaysWhatTheErrorIs) {
  EXPECT_EQ(text_faults("[1,"),
            "t:1:4: expected JSON, got an error while parsing value - unexpected end of input; "
            "expected '[', '{', or a literal");
}

TEST(JsonText, ErrorsAreShortWhateverWasRead) {
  std::string text = "[\"";
  for (int i = 0; i < 1000; ++i) text += "\xc3\xa9";
  for (const std::string& unfinished : {text, text + "x"}) {
    const std::string fault = text_faults(unfinished);
    EXPECT_LT(fault.size(), 300u);
    EXPECT_THAT(fault, ::testing::EndsWith("\xc3\xa9..."));  // cut between two characters
  }
}

TEST(JsonText, NumbersBeyondDoubleAreFaults) {
  EXPECT_THAT(text_faults("[1e999]"),
              StartsWith("t:1:6: expected JSON, got an error number overflow"));
}

TEST(JsonText, TextMustBeUtf8Throughout) {
  const std::vector<std::pair<std::string, std::string>> table = {
      {"\xef\xbb\xbf{}", "t:1:1: expected UTF-8 without a byte order mark, got a byte order mark"},
      {"[\"\xff\"]", "t:1:3: expected UTF-8 text, got the byte 0xff"},
      {"// \xe9\n{}", "t:1:4: expected UTF-8 text, got the byte 0xe9"},         // Latin-1
      {"\n[\"\xc0\x80\"]", "t:2:3: expected UTF-8 text, got the byte 0xc0"},    // overlong NUL
      {"[\"\xe0\x80\x80\"]", "t:1:3: expected UTF-8 text, got the byte 0xe0"},  // overlong
      {"[\"\xed\xa0\x80\"]", "t:1:3: expected UTF-8 text, got the byte 0xed"},  // surrogate
      {"[\"\xf0\x8f\xbf\xbf\"]", "t:1:3: expected UTF-8 text, got the byte 0xf0"},
      {"[\"\xf4\x90\x80\x80\"]", "t:1:3: expected UTF-8 text, got the byte 0xf4"},
      {"{}//\xe2\x82", "t:1:5: expected UTF-8 text, got the byte 0xe2"},  // cut at the end
      {std::string("{}\0 lost", 8), "t:1:3: expected UTF-8 text, got the byte 0x00"},
      {std::string("\xff\xfe{\0}\0", 6), "t:1:1: expected UTF-8 text, got the byte 0xff"},
  };
  for (const auto& [text, fault] : table) EXPECT_EQ(text_faults(text), fault);
}

TEST(JsonText, TakesTheBoundsOfEveryLengthOfUtf8) {
  // U+007F, U+0080, U+07FF, U+0800, U+D7FF, U+E000, U+FFFF, U+10000, U+10FFFF.
  const std::string text =
      "[\"\x7f\xc2\x80\xdf\xbf\xe0\xa0\x80\xed\x9f\xbf\xee\x80\x80\xef\xbf\xbf\xf0\x90\x80\x80"
      "\xf4\x8f\xbf\xbf\"]";
  EXPECT_EQ(text_faults(text, true), "");
}

TEST(JsonText, EveryDoubleKeyIsReportedWithItsPath) {
  EXPECT_EQ(
      text_faults(R"({"a": [0, {"b": 1, "b": 2, "b": 3}], "c": {}, "c d": 1, "c d": 1})", true),
      "t: $.a[1].b: expected the key once, got it twice\n"
      "t: $.a[1].b: expected the key once, got it twice\n"
      "t: $[\"c d\"]: expected the key once, got it twice");
}

TEST(JsonText, TheSameKeyInTwoObjectsIsFine) {
  EXPECT_EQ(text_faults(R"({"a": {"a": 1}, "b": [{"a": 1}, {"a": 2}]})", true), "");
}

TEST(JsonText, NestingEndsAt32) {
  EXPECT_EQ(text_faults(nested(32), true), "");
  EXPECT_THAT(text_faults(nested(33)),
              ::testing::EndsWith("]: expected at most 32 levels of nesting, got more"));
}

TEST(JsonText, NestingWithoutEndDoesNoHarm) {
  EXPECT_THAT(text_faults(std::string(5'000'000, '[')), ::testing::HasSubstr("levels of nesting"));
  std::string objects;
  for (int i = 0; i < 100'000; ++i) objects += "{\"a\":";
  EXPECT_THAT(text_faults(objects), ::testing::HasSubstr("$.a.a.a"));
}

TEST(JsonData, KeepsTheOrderOfKeysAndRefusesWhatADocumentMayNotHave) {
  EXPECT_EQ(
      parse_json_data("\xef\xbb\xbf{\"b\": [1, {\"z\": 2.5, \"y\": null}], \"a\": \"x\"}", "d")
          .dump(),
      R"({"b":[1,{"z":2.5,"y":null}],"a":"x"})");
  EXPECT_EQ(parse_json_data("[1] // one", "d", JsonComments::kPassedOver).dump(), "[1]");
  const auto refused = [](const std::string& text, const std::string& fault) {
    EXPECT_THAT([&] { parse_json_data(text, "d"); },
                ::testing::ThrowsMessage<std::runtime_error>(StartsWith(fault)))
        << text;
  };
  refused(R"({"a": {"b": 1, "b": 2}, "a": 3})", "d: $.a.b: expected the key once, got it twice");
  refused("[1] // one", "d:1:5: expected JSON, got an error");
  refused(nested(33), "d: $[0][0]");
  refused(std::string("[]\0", 3), "d:1:3: expected UTF-8 text, got the byte 0x00");
}

}  // namespace
}  // namespace eventgan
