#include "pipeline/folder/finalization_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

FinalizationReport report_of(int missing) {
  FinalizationReport report;
  report.folder = "out";
  report.shards_planned = missing + 1;
  report.counts.shards = 1;
  report.counts.samples = 5;
  report.counts.valid = 4;
  report.missing.resize(static_cast<std::size_t>(missing));
  for (std::size_t i = 0; i < report.missing.size(); ++i) {
    report.missing[i].outline.name = std::to_string(i) + ".h5";
  }
  return report;
}

TEST(FinalizationReportText, NamesEveryMissingShard) {
  const std::string text = to_text(report_of(2));
  EXPECT_THAT(text, HasSubstr("0.h5: missing\n1.h5: missing\n1 of 3 shards: 5 samples, 1 of them"));
  EXPECT_THAT(text, HasSubstr("--partial"));
}

TEST(FinalizationReportText, ADamagedShardIsNamedOnce) {
  FinalizationReport report = report_of(1);
  report.missing[0].condition = ShardCondition::kOtherSize;
  report.missing[0].faults = {"out/0.h5: expected size in bytes 5, got 4"};
  EXPECT_THAT(to_text(report), StartsWith("out/0.h5: expected size in bytes 5, got 4\n"));
}

TEST(FinalizationReportText, OfVeryManyTheFirst) {
  const std::string text = to_text(report_of(4000));
  EXPECT_THAT(text, HasSubstr("99.h5: missing\n... and 3900 more"));
  EXPECT_EQ(nlohmann::json::parse(to_json(report_of(4000)))["missing"].size(), 4000u);
}

TEST(FinalizationReportText, SaysWhatWasWritten) {
  FinalizationReport report = report_of(0);
  report.written = true;
  EXPECT_THAT(to_text(report), HasSubstr("out: dataset.json, dataset.h5\n"));
  EXPECT_THAT(to_text(report), Not(HasSubstr("PARTIAL")));
  report = report_of(1);
  report.written = true;
  EXPECT_THAT(to_text(report), HasSubstr("PARTIAL"));
}

}  // namespace
}  // namespace eventgan
