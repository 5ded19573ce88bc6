#include "pipeline/report/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Of a job as large as there are: every list longer than a page has room for, every text hostile.
Survey huge_survey() {
  constexpr char kHostile[] = "<script>alert('&')</script>";
  Survey survey;
  PlanOutline& plan = survey.parts.frozen.plan;
  plan.name = "job";
  plan.manifest_text = std::string(3'000'000, '<');
  survey.header.volume = {9, {260, 346}};
  for (int i = 0; i < 2000; ++i) {
    const std::string name = kHostile + std::to_string(i);
    SourceSpec source;
    source.root = name;
    survey.parts.manifest.sources.push_back(source);
    SourceSummary& summary = plan.sources.emplace_back();
    summary.notes = {name};
    SourceSurvey& numbers = survey.sources.emplace_back();
    numbers.counts.samples = 1000;
    numbers.events_per_pixel.add(1e-9 * (i + 1));
    if (i < Survey::kShownSources) numbers.picked.resize(5, {"random", name, 1, name});
    survey.counts.classes[name] = i + 1;
    survey.classes[name] = {10, 3};
    survey.joints[name] = {10, 3};
    survey.faults[name] = {2, {name, 1, name, name}};
    survey.splits[name] = {};
    plan.fingerprint[name] = std::string(1000, '&');
  }
  survey.quarantined.resize(Survey::kMostQuarantined,
                            {kHostile, 1, kHostile, std::string(5000, '"')});
  for (int i = 0; i < 20'000; ++i) {
    CommitRecord record;
    record.samples = record.valid = 64;
    survey.parts.done.push_back({{kHostile, 0, {}, 64}, ShardCondition::kDone, record});
    survey.parts.missing.push_back({{kHostile, 0, {}, 64}});
  }
  survey.counts.samples = survey.counts.valid = 1'280'000;
  survey.counts.boxes = 3'000'000;
  survey.box_sides.add(30);
  survey.positive_bins.assign(9, 0.1);
  survey.negative_bins.assign(9, 0.2);
  survey.volumes = Survey::kMostVolumes;
  return survey;
}

TEST(ReportPage, IsSmallAndWithoutForeignMarkupForAnyJob) {
  PageContext context;
  context.folder = "out";
  context.file = "out/report.html";
  context.warning = "<i>";
  int images = 0;
  context.image = [&](const PickedSample&) {
    ++images;
    return std::string(PageContext::kMostImageBytes, 'x');
  };
  const std::string page = report_page(huge_survey(), context);
  EXPECT_EQ(images, 5 * Survey::kShownSources);
  EXPECT_LT(page.size(), 5'000'000u);
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, Not(HasSubstr("<i>")));
  EXPECT_THAT(page, HasSubstr("data-key=\"samples\" data-value=\"1280000\""));
  EXPECT_THAT(page, HasSubstr("… and 1\u202F940 more")) << "2000 sources, 60 in the table";
}

TEST(ReportPage, LinksLeadFromThePageToTheShards) {
  Survey survey;
  survey.header.volume = {9, {2, 2}};
  survey.parts.done.push_back(
      {{"a b-00000-of-00001.h5", 0, {}, 1}, ShardCondition::kDone, CommitRecord{}});
  PageContext context;
  context.folder = "/data/ö/out";
  context.file = "/data/pages/report.html";
  const std::string page = report_page(survey, context);
  EXPECT_THAT(page, HasSubstr("href=\"../%C3%B6/out/a%20b-00000-of-00001.h5\""));
  EXPECT_THAT(page, Not(HasSubstr("class=warning"))) << "the weights are somebody's own";
}

TEST(ReportPage, CountsVolumesWithoutEventsAndWarnsWhereAllOfASourceAre) {
  Survey survey;
  survey.header.volume = {9, {2, 2}};
  survey.sources.resize(2);
  survey.parts.manifest.sources.resize(2);
  survey.parts.frozen.plan.sources.resize(2);
  for (SourceSurvey& source : survey.sources) source.counts.samples = source.counts.valid = 3;
  for (int i = 0; i < 3; ++i) survey.sources[0].events_per_pixel.add(0);
  for (const double events : {0.0, 0.5, 0.0}) survey.sources[1].events_per_pixel.add(events);
  PageContext context;
  context.folder = "out";
  context.file = "out/report.html";
  const std::string page = report_page(survey, context);
  EXPECT_THAT(page, HasSubstr("data-key=\"source.0.empty\" data-value=\"3\""));
  EXPECT_THAT(page, HasSubstr("data-key=\"source.1.empty\" data-value=\"2\""));
  EXPECT_THAT(page, HasSubstr("data-key=source.0.warning>Warning: all 3 volumes of "));
  EXPECT_THAT(page, Not(HasSubstr("source.1.warning")));
}

}  // namespace
}  // namespace eventgan
