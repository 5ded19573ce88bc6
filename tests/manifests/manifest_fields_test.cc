#include "manifests/manifest_fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

TEST(ManifestFields, AreNamedByTheirJsonPath) {
  EXPECT_THAT(manifest_fields(R"({"a": {"b": [1, 2.5]}, "c": "x", "d": [], "e": {}})"),
              ElementsAre(Pair("$.a.b[0]", "1"), Pair("$.a.b[1]", "2.5"), Pair("$.c", "\"x\""),
                          Pair("$.d", "[]"), Pair("$.e", "{}")));
}

TEST(ManifestFields, LeaveOutWhatDoesNotChangeTheBytes) {
  const auto fields =
      manifest_fields(R"({"output": {"directory": "x", "dtype": "uint8"}, // a comment
                                          "errors": {"policy": "fail"}})");
  EXPECT_THAT(fields, ElementsAre(Pair("$.output.dtype", "\"uint8\"")));
}

TEST(ManifestFields, OfNoJsonIsAnError) { EXPECT_THROW(manifest_fields("{"), std::runtime_error); }

}  // namespace
}  // namespace eventgan
