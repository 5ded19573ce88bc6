#include <gtest/gtest.h>

#include "manifests/strict_json/json_path_internal.h"

namespace eventgan {
namespace {

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

}  // namespace
}  // namespace eventgan
