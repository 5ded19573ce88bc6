#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <regex>
#include <set>
#include <stdexcept>
#include <string>

#include "pipeline/training/csv_table.h"
#include "pipeline/training/loss_log.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

const CsvTable::Row kColumns{"step", "loss"};

bool keep_all(const CsvTable::Row&) { return true; }

TEST(CsvTable, BeginsWithItsColumnsAndAnewWhereTheyDiffer) {
  const testing::TemporaryFolder folder;
  CsvTable table(folder / "t.csv", kColumns, keep_all);
  table.add({"0", "1.5"});
  table.add({"1", ""});
  table.flush();
  EXPECT_EQ(testing::read_file(folder / "t.csv"), "step,loss\n0,1.5\n1,\n");
  EXPECT_TRUE(table.kept().empty());
  EXPECT_THROWS(CsvTable("/nowhere/t.csv", kColumns, keep_all), std::runtime_error,
                "cannot create /nowhere");
}

TEST(CsvTable, CutsOffWhatIsNotToBeKeptAndATornEnd) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "t.csv", "step,loss\n0,1\n1,2\n2,3\n3,4\n");
  CsvTable table(folder / "t.csv", kColumns,
                 [](const CsvTable::Row& row) { return csv_value(row[0]) < 2; });
  EXPECT_EQ(table.kept(), (std::vector<CsvTable::Row>{{"0", "1"}, {"1", "2"}}));
  table.add({"2", "9"});
  table.flush();
  EXPECT_EQ(testing::read_file(folder / "t.csv"), "step,loss\n0,1\n1,2\n2,9\n");
  for (const char* torn : {"step,loss\n0,1\n1,2", "step,loss\n0,1\n1\n2,3\n"}) {
    testing::write_file(folder / "t.csv", torn);
    EXPECT_EQ(CsvTable(folder / "t.csv", kColumns, keep_all).kept(),
              (std::vector<CsvTable::Row>{{"0", "1"}}))
        << torn;
  }
}

TEST(CsvTable, BeginsAnewWhereTheColumnsDiffer) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "t.csv", "step,other\n0,1\n");
  const CsvTable table(folder / "t.csv", kColumns, keep_all);
  EXPECT_TRUE(table.kept().empty());
  EXPECT_EQ(testing::read_file(folder / "t.csv"), "step,loss\n");
}

TEST(CsvNumber, HasSixDigitsAndIsEmptyForNaN) {
  EXPECT_EQ(csv_number(1.0 / 3), "0.333333");
  EXPECT_EQ(csv_number(0), "0");
  EXPECT_EQ(csv_number(std::numeric_limits<double>::quiet_NaN()), "");
  EXPECT_EQ(csv_value("0.25"), 0.25);
  EXPECT_TRUE(std::isnan(csv_value("")));
  EXPECT_TRUE(std::isnan(csv_value("1x")));
}

constexpr auto kFlow = TrainingPhase::kFlow;
constexpr auto kGenerator = TrainingPhase::kGenerator;

TEST(LossLog, WritesARowAStep) {
  const testing::TemporaryFolder folder;
  LossLog log(folder / "training.csv", {});
  log.add({kFlow, 0}, 1.5, {{"flow", 0.25}, {"flow.smoothness", 2}, {"unknown", 7}}, 1e-3);
  log.flush();
  EXPECT_EQ(testing::read_file(folder / "training.csv"),
            "phase,step,seconds,flow,flow.photometric,flow.smoothness,reconstruction,volume,count,"
            "overlap,likelihood,block_likelihood,"
            "generator,generator.total,discriminator,discriminator.real_accuracy,"
            "discriminator.fake_accuracy,learning_rate\n"
            "flow,0,1.5,0.25,,2,,,,,,,,,,,,0.001\n");
  ASSERT_EQ(log.rows().size(), 1u);
  EXPECT_EQ(log.rows()[0].losses[0], 0.25);
  EXPECT_TRUE(std::isnan(log.rows()[0].losses[1]));
}

TEST(LossLog, GoesOnAfterTheCheckpointsStep) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "training.csv";
  {
    LossLog log(file, {});
    for (int step = 0; step < 3; ++step) log.add({kFlow, step}, step, {{"flow", step}}, 1);
    for (int step = 0; step < 3; ++step) log.add({kGenerator, step}, step, {{"volume", step}}, 1);
  }
  LossLog log(file, {kGenerator, 1});
  ASSERT_EQ(log.rows().size(), 4u);
  EXPECT_EQ(log.rows().back().position, (TrainingPosition{kGenerator, 0}));
  log.add({kGenerator, 1}, 9, {{"volume", 5}}, 1);
  log.flush();
  const std::string text = testing::read_file(file);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 6);
  EXPECT_EQ(text.find("generator,2,"), std::string::npos);
}

TEST(LossLog, WithoutACheckpointEverythingGoes) {
  const testing::TemporaryFolder folder;
  { LossLog(folder / "training.csv", {}).add({kFlow, 0}, 0, {{"flow", 1}}, 1); }
  EXPECT_TRUE(LossLog(folder / "training.csv", {}).rows().empty());
}

TEST(MeanLosses, AreOverTheLastStepsOfThePhaseThatHaveThem) {
  const testing::TemporaryFolder folder;
  LossLog log(folder / "training.csv", {});
  log.add({kFlow, 0}, 0, {{"flow", 100}}, 1);
  log.add({kGenerator, 0}, 0, {{"volume", 50}}, 1);
  log.add({kGenerator, 1}, 0, {{"discriminator", 2}}, 1);
  log.add({kGenerator, 2}, 0, {{"volume", 1}}, 1);
  log.add({kGenerator, 3}, 0, {{"volume", 3}}, 1);
  EXPECT_EQ(mean_losses(log.rows(), kGenerator, 3),
            (std::map<std::string, double>{{"discriminator", 2}, {"volume", 2}}));
  EXPECT_EQ(mean_losses(log.rows(), kGenerator, 100).at("volume"), 18);
  EXPECT_TRUE(mean_losses({}, kGenerator, 3).empty());
}

LossRow row_of(std::int64_t step, std::size_t loss, double value) {
  LossRow row;
  row.position = {TrainingPhase::kGenerator, step};
  row.losses.fill(std::numeric_limits<double>::quiet_NaN());
  row.losses[loss] = value;
  return row;
}

std::size_t count_of(const std::string& what, const std::string& text) {
  std::size_t count = 0;
  for (auto at = text.find(what); at != text.npos; at = text.find(what, at + 1)) ++count;
  return count;
}

TEST(LossCurves, HaveAPanelForEachLossThatIsThere) {
  std::vector<LossRow> rows;
  for (int i = 0; i < 50; ++i) {
    rows.push_back(row_of(i, static_cast<std::size_t>(i % 3), std::exp(-i / 5.0)));
  }
  rows[0].position.phase = TrainingPhase::kFlow;
  const std::string svg = loss_curves(rows);
  for (const std::size_t loss : {0u, 1u, 2u}) {
    EXPECT_EQ(count_of(">" + std::string(kLossNames[loss]) + "</text>", svg), 1u);
  }
  EXPECT_EQ(count_of(">logarithmic</text>", svg), 3u) << "exp(-9) is less than a hundredth";
  EXPECT_EQ(count_of("\"s0 faint line\"", svg), 3u);
  EXPECT_EQ(count_of("\"axis rule\"", svg), 2u) << "two losses have values around the border";
}

TEST(LossCurves, EachPhaseHasALineAndAMeanOfItsOwn) {
  std::vector<LossRow> rows;
  for (int i = 0; i < 300; ++i) {  // a window of the mean is more than one step
    rows.push_back(row_of(i, i / 100 == 1 ? 1 : 0, i < 100 ? 100 : 1));
    if (i < 100) rows.back().position.phase = TrainingPhase::kFlow;
  }
  const std::string svg = loss_curves(rows);
  const std::size_t mean = svg.find("\"s1 line\"");
  ASSERT_NE(mean, svg.npos);
  const std::string way = svg.substr(mean, svg.find("</path>", mean) - mean);
  EXPECT_EQ(count_of("M", way), 2u) << way;
  // 100 and 1 are two heights, and nothing lies between.
  const std::regex place("[ML][0-9.]+ ([0-9.]+)");
  std::set<std::string> heights;
  for (std::sregex_iterator at(way.begin(), way.end(), place), none; at != none; ++at) {
    heights.insert((*at)[1]);
  }
  EXPECT_EQ(heights.size(), 2u) << way;
}

TEST(LossCurves, AreDrawnOfExtremes) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(count_of("faint line\"", loss_curves({})), 0u);
  const std::vector<std::vector<LossRow>> cases{{row_of(0, 0, 1)},
                                                {row_of(0, 0, 0), row_of(1, 0, 0)},
                                                {row_of(0, 0, -1e30), row_of(1, 0, 1e30)},
                                                {row_of(0, 0, 1e-30), row_of(1, 0, 1e30)},
                                                {row_of(0, 0, kInfinite), row_of(1, 0, 1)}};
  for (const auto& rows : cases) EXPECT_EQ(count_of("faint line\"", loss_curves(rows)), 1u);
}

}  // namespace
}  // namespace eventgan
