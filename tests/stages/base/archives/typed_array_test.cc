#include "stages/base/archives/typed_array.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "stages/base/archives/array_json.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(TypedArrayTest, GivesEveryKindOfNumberApartFromTextAndItsShape) {
  EXPECT_EQ((TypedArray{{2}, std::vector<double>{1.5, -2}}.number(1)), -2);
  EXPECT_EQ((TypedArray{{1}, std::vector<float>{0.1f}}.number(0)), double{0.1f});
  EXPECT_EQ((TypedArray{{1}, std::vector<std::int64_t>{-7}}.number(0)), -7);
  EXPECT_EQ((TypedArray{{1}, std::vector<std::int32_t>{-7}}.number(0)), -7);
  EXPECT_EQ((TypedArray{{1}, std::vector<std::uint8_t>{200}}.number(0)), 200);
  EXPECT_EQ((TypedArray{{2}, std::vector<bool>{false, true}}.number(1)), 1);
  const TypedArray names{{2}, std::vector<std::string>{"a", "b"}};
  EXPECT_TRUE(names.is_text());
  EXPECT_EQ(names.text(1), "b");
  EXPECT_THROWS(names.number(0), std::invalid_argument, "expected an array of numbers, got text");
  EXPECT_THROWS(names.text(2), std::out_of_range, "range_check");
  const TypedArray numbers{{1}, std::vector<double>{1}};
  EXPECT_FALSE(numbers.is_text());
  EXPECT_THROWS(numbers.text(0), std::invalid_argument, "expected an array of text, got numbers");
  EXPECT_THROWS(numbers.number(1), std::out_of_range, "range_check");
  const TypedArray matrix{{2, 1}, std::vector<double>{1, 2}};
  EXPECT_EQ(matrix.size(), 2u);
  EXPECT_EQ(matrix.shape_text(), "[2, 1]");
  EXPECT_EQ((TypedArray{{}, std::vector<double>{1}}.shape_text()), "[]");
}

TEST(TypedArrayJsonTest, NestsTheElementsInCOrderExactOrNull) {
  const TypedArray array{{2, 1, 2}, std::vector<std::int32_t>{1, 2, 3, -4}};
  EXPECT_EQ(to_json(array).dump(), "[[[1,2]],[[3,-4]]]");
  EXPECT_EQ(to_json(array, 1).dump(), "[[3,-4]]");
  EXPECT_EQ(to_json(TypedArray{{}, std::vector<std::string>{"a"}}).dump(), R"("a")");
  EXPECT_EQ(to_json(TypedArray{{0, 3}, std::vector<double>{}}).dump(), "[]");
  EXPECT_EQ(to_json(TypedArray{{2}, std::vector<bool>{false, true}}).dump(), "[false,true]");
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
