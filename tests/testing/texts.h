#pragma once

#include <gmock/gmock.h>

#include <exception>
#include <initializer_list>
#include <string>
#include <vector>

namespace eventgan::testing {

using TextMatcher = ::testing::Matcher<const std::string&>;

/// What a text must be: a text that has this part, these parts, or what the matcher wants.
struct Words {
  Words(const char* part) : matcher(::testing::HasSubstr(part)) {}
  Words(const std::string& part) : matcher(::testing::HasSubstr(part)) {}
  Words(std::initializer_list<std::string> parts) {
    std::vector<TextMatcher> all;
    for (const std::string& part : parts) all.emplace_back(::testing::HasSubstr(part));
    matcher = ::testing::AllOfArray(all);
  }
  template <class Matcher>
  Words(const Matcher& whole) : matcher(::testing::SafeMatcherCast<const std::string&>(whole)) {}

  TextMatcher matcher;
};

/// What an exception says, and the one for which it was thrown.
inline std::string text_of(const std::exception& error) {
  try {
    std::rethrow_if_nested(error);
  } catch (const std::exception& cause) {
    return std::string(error.what()) + ": " + text_of(cause);
  }
  return error.what();
}

/// Exactly these texts, in this order.
inline ::testing::Matcher<const std::vector<std::string>&> texts_with(
    std::initializer_list<Words> texts) {
  std::vector<TextMatcher> matchers;
  for (const Words& text : texts) matchers.push_back(text.matcher);
  return ::testing::ElementsAreArray(matchers);
}

}  // namespace eventgan::testing

/// As EXPECT_THROW, and the exception's text has the words that follow (see Words).
#define EXPECT_THROWS(statement, Type, ...)                   \
  EXPECT_THAT(([&]() -> std::string {                         \
                try {                                         \
                  statement;                                  \
                } catch (const Type& error) {                 \
                  return ::eventgan::testing::text_of(error); \
                }                                             \
                return "nothing of the type " #Type;          \
              }()),                                           \
              (::eventgan::testing::Words{__VA_ARGS__}.matcher))
