#include "pipeline/training/records/csv_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

const CsvTable::Row kColumns{"step", "loss"};

bool keep_all(const CsvTable::Row&) { return true; }

TEST(CsvTable, BeginsWithItsColumns) {
  const testing::TemporaryFolder folder;
  CsvTable table(folder / "t.csv", kColumns, keep_all);
  table.add({"0", "1.5"});
  table.add({"1", ""});
  table.flush();
  EXPECT_EQ(testing::read_file(folder / "t.csv"), "step,loss\n0,1.5\n1,\n");
  EXPECT_TRUE(table.kept().empty());
}

TEST(CsvTable, CutsOffWhatIsNotToBeKept) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "t.csv", "step,loss\n0,1\n1,2\n2,3\n3,4\n");
  CsvTable table(folder / "t.csv", kColumns,
                 [](const CsvTable::Row& row) { return csv_value(row[0]) < 2; });
  EXPECT_EQ(table.kept(), (std::vector<CsvTable::Row>{{"0", "1"}, {"1", "2"}}));
  table.add({"2", "9"});
  table.flush();
  EXPECT_EQ(testing::read_file(folder / "t.csv"), "step,loss\n0,1\n1,2\n2,9\n");
}

TEST(CsvTable, CutsOffATornEnd) {
  const testing::TemporaryFolder folder;
  for (const char* torn : {"step,loss\n0,1\n1,2", "step,loss\n0,1\n1\n2,3\n"}) {
    testing::write_file(folder / "t.csv", torn);
    const CsvTable table(folder / "t.csv", kColumns, keep_all);
    EXPECT_EQ(table.kept(), (std::vector<CsvTable::Row>{{"0", "1"}})) << torn;
  }
}

TEST(CsvTable, BeginsAnewWhereTheColumnsDiffer) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "t.csv", "step,other\n0,1\n");
  const CsvTable table(folder / "t.csv", kColumns, keep_all);
  EXPECT_TRUE(table.kept().empty());
  EXPECT_EQ(testing::read_file(folder / "t.csv"), "step,loss\n");
}

TEST(CsvTable, NamesTheFileItCannotWrite) {
  EXPECT_THROW(CsvTable("/nowhere/t.csv", kColumns, keep_all), std::runtime_error);
}

TEST(CsvNumber, HasSixDigitsAndIsEmptyForNaN) {
  EXPECT_EQ(csv_number(1.0 / 3), "0.333333");
  EXPECT_EQ(csv_number(0), "0");
  EXPECT_EQ(csv_number(std::numeric_limits<double>::quiet_NaN()), "");
  EXPECT_EQ(csv_value("0.25"), 0.25);
  EXPECT_TRUE(std::isnan(csv_value("")));
  EXPECT_TRUE(std::isnan(csv_value("1x")));
}

}  // namespace
}  // namespace eventgan
