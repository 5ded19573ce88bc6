#include <gtest/gtest.h>

#include <cmath>

#include "stages/archives/typed_array_json_internal.h"

namespace eventgan {
namespace {

TEST(TypedArrayJsonTest, NestsTheElementsInCOrder) {
  const TypedArray array{{2, 1, 2}, std::vector<std::int32_t>{1, 2, 3, -4}};
  EXPECT_EQ(to_json(array).dump(), "[[[1,2]],[[3,-4]]]");
  EXPECT_EQ(to_json(array, 1).dump(), "[[3,-4]]");
  EXPECT_EQ(to_json(TypedArray{{}, std::vector<std::string>{"a"}}).dump(), R"("a")");
  EXPECT_EQ(to_json(TypedArray{{0, 3}, std::vector<double>{}}).dump(), "[]");
  EXPECT_EQ(to_json(TypedArray{{2}, std::vector<bool>{false, true}}).dump(), "[false,true]");
}

TEST(TypedArrayJsonTest, NumbersAreExactOrNull) {
  const TypedArray doubles{{3}, std::vector<double>{0.1, std::nan(""), -INFINITY}};
  EXPECT_EQ(to_json(doubles).dump(), "[0.1,null,null]");
  // 0.1f, written out, is the double nearest to it.
  EXPECT_EQ(to_json(TypedArray{{1}, std::vector<float>{0.1f}}, 0).get<double>(), double{0.1f});
  // 2^53 + 1 would lose its last bit as a double.
  const TypedArray whole{{1}, std::vector<std::int64_t>{9007199254740993}};
  EXPECT_EQ(to_json(whole).dump(), "[9007199254740993]");
}

}  // namespace
}  // namespace eventgan
