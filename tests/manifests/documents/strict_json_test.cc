#include "manifests/documents/strict_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

namespace eventgan {
namespace {

constexpr std::array<std::string_view, 4> kWords{"root", "split", "samples_per_shard", "raw_root"};

TEST(NearWord, IsTheOneFewestEditsAway) {
  for (const auto& [word, near] : {std::pair("rot", "root"),  // inserted
                                   {"splitt", "split"},       // deleted
                                   {"Root", "root"},          // replaced
                                   {"roto", "root"},          // neighbours swapped
                                   {"raw_rot", "raw_root"},
                                   {"sample_per_shards", "samples_per_shard"},  // two edits
                                   {"rt", ""},  // two edits, but "root" is short
                                   {"", ""},
                                   {"directory", ""}}) {
    EXPECT_EQ(near_word(word, kWords), near) << word;
  }
  EXPECT_EQ(near_word("root", {}), "");
  EXPECT_EQ(near_word(std::string(1'000'000, 'r'), kWords), "");
  constexpr std::array<std::string_view, 2> kTwo{"bat", "cat"};
  EXPECT_EQ(near_word("rat", kTwo), "bat") << "of two that are equally near the first";
}

enum class Colour { kRed, kGreen };
constexpr std::array kColours{Word<Colour>{"red", Colour::kRed},
                              Word<Colour>{"green", Colour::kGreen}};

/// A document with its reader and list.
struct Reading {
  explicit Reading(const char* text) : document(nlohmann::json::parse(text)) {}
  StrictValue value() { return StrictValue(document, faults); }
  StrictObject object() { return value().object(); }

  nlohmann::json document;
  FaultList faults{"d"};
};

TEST(StrictValue, IntegerTakesItsRange) {
  EXPECT_EQ(Reading("-3").value().integer(-3, 3), -3);
  EXPECT_EQ(Reading("3").value().integer(-3, 3), 3);
  constexpr auto kLeast = std::numeric_limits<std::int64_t>::min();
  constexpr auto kMost = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(Reading("-9223372036854775808").value().integer(kLeast, kMost), kLeast);
  EXPECT_EQ(Reading("9223372036854775807").value().integer(kLeast, kMost), kMost);
}

TEST(StrictValue, IntegerRefusesAllElse) {
  for (const char* text :
       {"-4", "4", "2.5", "2.0", "2e0", "\"2\"", "null", "true", "18446744073709551615"}) {
    Reading reading(text);                                  // the last would be -1 as int64
    EXPECT_EQ(reading.value().integer(-3, 3), -3) << text;  // the harmless value
    EXPECT_THAT(reading.faults.text(),
                ::testing::StartsWith("d: $: expected an integer -3..3, got "));
    EXPECT_EQ(reading.value().sound_integer(-3, 3), std::nullopt);
  }
}

TEST(StrictValue, NumbersTextAndChoicesAreTakenOrSayWhatIsAllowed) {
  EXPECT_EQ(Reading("1").value().number(0, 1), 1.0);
  EXPECT_EQ(Reading("0.25").value().number(0, 1), 0.25);
  EXPECT_EQ(Reading(R"("a\u0000b")").value().text(), std::string("a\0b", 3));
  const auto is_a = [](std::string_view text) { return text == "a"; };
  EXPECT_EQ(Reading(R"("a")").value().text("an a", is_a), "a");
  EXPECT_EQ(Reading(R"("green")").value().choice(kColours), Colour::kGreen);
  Reading high("1.5"), text("\"1\""), wrong(R"("b")"), blue(R"("blue")");
  EXPECT_EQ(high.value().number(0.5, 1), 0.5);
  text.value().number(0, 1);
  EXPECT_EQ(wrong.value().text("an a", is_a), "");
  EXPECT_EQ(blue.value().sound_choice(kColours), std::nullopt);
  EXPECT_EQ(high.faults.text(), "d: $: expected a number 0.5..1, got 1.5");
  EXPECT_EQ(text.faults.text(), "d: $: expected a number 0..1, got \"1\"");
  EXPECT_EQ(wrong.faults.text(), "d: $: expected an a, got \"b\"");
  EXPECT_EQ(blue.faults.text(), R"(d: $: expected "red" or "green", got "blue")");
}

TEST(StrictValue, ElementsAndSortedMembersHaveTheirPaths) {
  Reading array(R"([1, [2, "x"]])"), object(R"({"b c": "x", "a": 1})"), one("[1]");
  const auto elements = array.value().elements(2);
  ASSERT_EQ(elements.size(), 2u);
  EXPECT_EQ(elements[0].integer(0, 9), 1);
  EXPECT_EQ(array.faults.text(), "");
  elements[1].elements()[1].integer(0, 9);
  EXPECT_EQ(array.faults.text(), "d: $[1][1]: expected an integer 0..9, got \"x\"");
  const auto members = object.value().members();
  ASSERT_EQ(members.size(), 2u);
  EXPECT_EQ(members[0].first, "a");
  members[1].second.integer(0, 9);
  EXPECT_EQ(object.faults.text(), "d: $[\"b c\"]: expected an integer 0..9, got \"x\"");
  EXPECT_TRUE(one.value().elements(2).empty());
  EXPECT_EQ(one.faults.text(), "d: $: expected an array of 2 or more, got an array of 1");
}

TEST(StrictValue, MessagesAreShortAndPrintable) {
  Reading reading(("\"\\u001b[31m\xc3\xa9" + std::string(1000, 'x') + "\"").c_str());
  reading.value().integer(0, 9);
  EXPECT_EQ(reading.faults.text(), "d: $: expected an integer 0..9, got \"\\u001b[31m\\u00e9" +
                                       std::string(80 - 1 - 16, 'x') + "...");
}

TEST(StrictObject, ReadsWhatIsThere) {
  Reading reading(R"({"a": 1, "b": {"c": "x"}})");
  StrictObject object = reading.object();
  EXPECT_EQ(object.at("a").integer(0, 9), 1);
  StrictObject inner = object.at("b").object();
  EXPECT_EQ(inner.find("c")->text(), "x");
  EXPECT_FALSE(inner.find("d").has_value());
  inner.finish();
  object.finish();
  EXPECT_EQ(reading.faults.text(), "");
}

TEST(StrictObject, SaysWhatIsMissingAndWhatIsUnknown) {
  Reading empty("{}"), array("[]"), unknown(R"({"widht": 1, "zz": 2, "height": 3})");
  StrictObject object = empty.object();
  object.at("a").integer(0, 9);
  object.at("b").object().at("c").text();  // below what is missing nothing more is missed
  object.at("d").elements();
  EXPECT_EQ(empty.faults.text(),
            "d: $.a: expected an integer 0..9, got nothing\n"
            "d: $.b: expected an object, got nothing\n"
            "d: $.d: expected an array, got nothing");
  StrictObject none = array.object();
  none.at("a").integer(0, 9);
  EXPECT_FALSE(none.find("b").has_value());
  none.finish();
  EXPECT_EQ(array.faults.text(), "d: $: expected an object, got an array of 0") << "one fault";
  StrictObject sized = unknown.object();
  for (const char* key : {"width", "width", "height"}) sized.find(key);  // each is listed once
  sized.finish();
  EXPECT_EQ(unknown.faults.text(),
            "d: $.widht: expected the key \"width\" or none, got an unknown key\n"
            "d: $.zz: expected one of the keys width, height, got an unknown key");
}

TEST(StrictObject, FormatAndVersionMustBeThese) {
  EXPECT_TRUE(Reading(R"({"format": "f", "version": 2})").object().has_format("f", 2));
  for (const char* text :
       {R"({"format": "f", "version": 2.0})", R"({"format": "f", "version": true})",
        R"({"format": "f"})", R"({"version": 2})", R"({"format": 2, "version": 2})"}) {
    Reading reading(text);
    EXPECT_FALSE(reading.object().has_format("f", 2)) << text;
    EXPECT_FALSE(reading.faults.empty()) << text;
  }
  Reading neither("{}");
  neither.object().has_format("f", 2);
  EXPECT_EQ(neither.faults.text(),
            "d: $.format: expected \"f\", got nothing\n"
            "d: $.version: expected 2 (the version that this program reads), got nothing");
}

TEST(FormatVersion, EveryMinorOfTheOwnMajorIsReadable) {
  constexpr FormatVersion kOwn{2, 1};
  EXPECT_EQ(to_string(kOwn), "2.1");
  EXPECT_EQ(readable_version("2.0", kOwn), (FormatVersion{2, 0}));
  EXPECT_EQ(readable_version("2.1", kOwn), kOwn);
  EXPECT_EQ(readable_version("2.13", kOwn), (FormatVersion{2, 13}));
  for (const char* other : {"", "2", "2.", ".1", "2.01", "02.1", "2.1 ", " 2.1", "2.-1", "-2.1",
                            "2,1", "2.1.0", "1.1", "3.0", "20.1", "2.99999999999"}) {
    EXPECT_EQ(readable_version(other, kOwn), std::nullopt) << other;
  }
}

TEST(StrictObject, OfALaterMinorVersionUnknownKeysAreNamed) {
  const auto read = [](Reading& reading) {
    StrictObject object = reading.object();
    if (!object.has_format("f", FormatVersion{1, 1})) return false;
    for (const StrictValue& element : object.at("list").elements()) {
      StrictObject entry = element.object();
      entry.at("a").integer(0, 9);
      entry.finish();
    }
    object.finish();
    return true;
  };
  Reading later(
      R"({"format": "f", "version": "1.2", "new": 1, "list": [{"a": 1, "b c": 2}, {"a": 3, "b c": 4}]})");
  EXPECT_TRUE(read(later));
  EXPECT_EQ(later.faults.text(), "");
  EXPECT_THAT(later.faults.unknown_keys(), ::testing::ElementsAre("$.list[][\"b c\"]", "$.new"));

  Reading missing(R"({"format": "f", "version": "1.2", "list": [{}]})");
  EXPECT_TRUE(read(missing));
  EXPECT_EQ(missing.faults.text(), "d: $.list[0].a: expected an integer 0..9, got nothing");

  Reading same(R"({"format": "f", "version": "1.1", "new": 1, "list": []})");
  EXPECT_TRUE(read(same));
  EXPECT_EQ(same.faults.text(),
            "d: $.new: expected one of the keys format, version, list, got an unknown key");

  Reading other(R"({"format": "f", "version": "2.0"})");
  EXPECT_FALSE(read(other));
  EXPECT_EQ(other.faults.text(),
            R"(d: $.version: expected "1.1" (this program reads versions 1.x), got "2.0")");
  Reading number(R"({"format": "f", "version": 1.1})");
  EXPECT_FALSE(read(number));
}

}  // namespace
}  // namespace eventgan
