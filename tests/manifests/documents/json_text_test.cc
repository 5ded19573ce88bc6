#include "manifests/documents/json_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::StartsWith;

TEST(JsonPath, QuotesOddKeysInAscii) {
  for (const auto& [at, key, path] : {std::tuple("$", "max_count", "$.max_count"),
                                      {"$.a", "B2", "$.a.B2"},
                                      {"$", "", R"($[""])"},
                                      {"$", "a b", R"($["a b"])"},
                                      {"$", "a\"]\n", R"($["a\"]\n"])"},
                                      {"$", "\xc3\xa9", R"($["\u00e9"])"}}) {
    EXPECT_EQ(json_path(at, key), path);
  }
  EXPECT_EQ(json_path("$.a", std::size_t{12}), "$.a[12]");
}

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

TEST(FaultList, KeepsTheOrder) {
  FaultList faults("m");
  EXPECT_TRUE(faults.empty());
  EXPECT_EQ(faults.text(), "");
  faults.add("$.b", "1", "2");
  faults.add("$.a", "x", "y");
  EXPECT_FALSE(faults.empty());
  EXPECT_EQ(faults.text(), "m: $.b: expected 1, got 2\nm: $.a: expected x, got y");
}

TEST(FaultList, CountsLinesAndCharactersFrom1) {
  // Line 2 is é in two bytes (2, 3), then z; beyond the end is the end.
  for (const auto& [byte, place] :
       {std::pair(0, "1:1"), {1, "1:2"}, {2, "2:1"}, {4, "2:2"}, {6, "3:1"}, {99, "3:1"}}) {
    FaultList faults("m");
    faults.add_at("a\n\xc3\xa9z\n", byte, "x", "y");
    EXPECT_EQ(faults.text(), "m:" + std::string(place) + ": expected x, got y");
  }
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

TEST(JsonText, FaultsHaveLineAndColumn) {
  // The position is where the reader stopped: at the last byte it took, or at the end.
  const std::string error = "expected JSON, got an error ", parsing = error + "while parsing",
                    byte = "expected UTF-8 text, got the byte 0x";
  const std::vector<std::pair<std::string, std::string>> table = {
      {"", "1:1: " + parsing},
      {"   ", "1:4: " + parsing},
      {"{\n  \"a\": 1,\n  b\n}", "3:3: " + parsing},
      {"{\n\"a\": 1\n", "3:1: " + parsing},
      {"{\"a\": 1,}", "1:9: " + parsing},
      {"[1 2]", "1:4: " + parsing},
      {"{} {}", "1:4: " + parsing},
      {"[NaN]", "1:2: " + parsing},
      {"[\"\xc3\xa9\", x]", "1:7: " + parsing},  // é is one character
      {"[01]", "1:3: " + parsing},
      {"[\"a\nb\"]", "1:4: " + parsing},
      {"/* open", "1:8: " + parsing},
      {"[1,",
       "1:4: " + parsing + " value - unexpected end of input; expected '[', '{', or a literal"},
      {"[1e999]", "1:6: " + error + "number overflow"},
      {"\xef\xbb\xbf{}", "1:1: expected UTF-8 without a byte order mark, got a byte order mark"},
      {"[\"\xff\"]", "1:3: " + byte + "ff"},
      {"// \xe9\n{}", "1:4: " + byte + "e9"},         // Latin-1
      {"\n[\"\xc0\x80\"]", "2:3: " + byte + "c0"},    // overlong NUL
      {"[\"\xe0\x80\x80\"]", "1:3: " + byte + "e0"},  // overlong
      {"[\"\xed\xa0\x80\"]", "1:3: " + byte + "ed"},  // surrogate
      {"[\"\xf0\x8f\xbf\xbf\"]", "1:3: " + byte + "f0"},
      {"[\"\xf4\x90\x80\x80\"]", "1:3: " + byte + "f4"},
      {"{}//\xe2\x82", "1:5: " + byte + "e2"},  // cut at the end
      {std::string("{}\0 lost", 8), "1:3: " + byte + "00"},
      {std::string("\xff\xfe{\0}\0", 6), "1:1: " + byte + "ff"},
  };
  for (const auto& [text, fault] : table) {
    EXPECT_THAT(text_faults(text), StartsWith("t:" + fault)) << text;
  }
  EXPECT_THAT(text_faults(nested(33)),
              ::testing::EndsWith("]: expected at most 32 levels of nesting, got more"));
}

TEST(JsonText, EveryDoubleKeyIsReportedWithItsPath) {
  EXPECT_EQ(
      text_faults(R"({"a": [0, {"b": 1, "b": 2, "b": 3}], "c": {}, "c d": 1, "c d": 1})", true),
      "t: $.a[1].b: expected the key once, got it twice\n"
      "t: $.a[1].b: expected the key once, got it twice\n"
      "t: $[\"c d\"]: expected the key once, got it twice");
}

TEST(JsonText, WithoutFaultsIsTaken) {
  for (const std::string& text :
       {std::string(R"({"a": {"a": 1}, "b": [{"a": 1}, {"a": 2}]})"), nested(32),
        // U+007F, U+0080, U+07FF, U+0800, U+D7FF, U+E000, U+FFFF, U+10000, U+10FFFF.
        std::string("[\"\x7f\xc2\x80\xdf\xbf\xe0\xa0\x80\xed\x9f\xbf\xee\x80\x80\xef\xbf\xbf\xf0"
                    "\x90\x80\x80"
                    "\xf4\x8f\xbf\xbf\"]")}) {
    EXPECT_EQ(text_faults(text, true), "");
  }
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
    EXPECT_THROWS(parse_json_data(text, "d"), std::runtime_error, StartsWith(fault)) << text;
  };
  refused(R"({"a": {"b": 1, "b": 2}, "a": 3})", "d: $.a.b: expected the key once, got it twice");
  refused("[1] // one", "d:1:5: expected JSON, got an error");
  refused(nested(33), "d: $[0][0]");
  refused(std::string("[]\0", 3), "d:1:3: expected UTF-8 text, got the byte 0x00");
}

}  // namespace
}  // namespace eventgan
