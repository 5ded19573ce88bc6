#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "stages/frames/human36m/table_columns_internal.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::ThrowsMessage;

TableColumns columns() {
  return TableColumns({{"points", {{2, 3, 1}, std::vector<double>{1, 2, 3, 4, 5, 6}}},
                       {"name", {{2}, std::vector<std::string>{"a", "b"}}},
                       {"frame", {{2}, std::vector<double>{7, 7.5}}},
                       {"single", {{}, std::vector<double>{9}}},
                       {"x/other", {{2}, std::vector<std::int32_t>{1, 2}}}},
                      "file.h5");
}

TEST(TableColumnsTest, ComparesShapes) {
  const TableColumns table = columns();
  const auto any = std::nullopt;
  EXPECT_EQ(table.need("points", {2, any, 1}).size(), 6u);
  EXPECT_EQ(table.need("name", {any}, /*text=*/true).size(), 2u);
  EXPECT_THAT(
      [&] {
        table.need("points", {any, 4, 1});
      },
      ThrowsMessage<InputError>("expected numbers [at least 1, 4, 1], got numbers [2, 3, 1], "
                                "in file.h5 (points)"));
  EXPECT_THROW(table.need("points", {2, 3}), InputError);
  EXPECT_THROW(table.need("points", {2, 3, 1, 1}), InputError);
  EXPECT_THROW(table.need("name", {2}), InputError);
  EXPECT_THROW(table.need("frame", {2}, /*text=*/true), InputError);
  EXPECT_THAT(
      [&] { table.need("absent", {2}); },
      ThrowsMessage<InputError>("expected numbers [2], got no such array, in file.h5 (absent)"));
}

TEST(TableColumnsTest, GivesRows) {
  const TableColumns table = columns();
  EXPECT_THAT(table.row_of("points", 1), ElementsAre(4, 5, 6));
  EXPECT_EQ(table.whole_number("frame", 0), 7);
  EXPECT_THROW(table.whole_number("frame", 1), InputError);
  EXPECT_EQ(table.fields(1, 2, "x/").dump(),
            R"({"frame":7.5,"name":"b","points":[[4.0],[5.0],[6.0]]})");
  EXPECT_EQ(table.fields(0, 2)["x/other"], 1);
  EXPECT_EQ(table.fields(0, 3).dump(), "{}");
}

TEST(TableColumnsTest, FindsValuesThatAreNotFinite) {
  const TableColumns table = columns();
  EXPECT_FALSE(table.not_finite({0, -1e300}, "points", 0));
  EXPECT_EQ(table.not_finite({0, -std::numeric_limits<double>::infinity()}, "points", 4)->reason,
            "expected finite numbers, got -inf, in file.h5 (points, row 4)");
}

}  // namespace
}  // namespace eventgan
