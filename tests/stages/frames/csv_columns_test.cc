#include "stages/frames/csv_columns.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

namespace eventgan {
namespace {

using ::testing::ElementsAre;

TEST(CsvColumns, AreFoundByTheirNames) {
  constexpr std::array<std::string_view, 3> kTableColumns = {"x", "y", "z"};
  const auto places = [&](const char* header) {
    return csv_columns(*CsvReader(header).next(), kTableColumns, 2);
  };
  EXPECT_THAT(*places("z,x,y"), ElementsAre(1, 2, 0));
  EXPECT_THAT(*places("y, x"), ElementsAre(1, 0, std::nullopt));
  EXPECT_EQ(places("x,z").fault().reason, "expected a column y, got none");
  EXPECT_EQ(places("x,y,x").fault().reason, "expected columns x, y, z, each once, got \"x\"");
  EXPECT_EQ(places("x,y,w\t1").fault().reason,
            "expected columns x, y, z, each once, got \"w\\t1\"");
}

}  // namespace
}  // namespace eventgan
