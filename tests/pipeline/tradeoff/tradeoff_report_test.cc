#include "pipeline/tradeoff/tradeoff_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsNan;

Trial trial_of(const std::string& weights, double pairs_per_s, double error) {
  Trial trial;
  trial.configuration = {{GeneratorKind::kNetwork, weights}, StoredType::kFloat16};
  trial.lines = {"\"generator\": {\"weights\":\"" + weights + "\"}", "\"output\": {}"};
  trial.losses = {{error, 0.5, 0.9, 0.8, 0.7, 10, 1}};
  trial.rounds = {{0.01, 1 / pairs_per_s, 0.5, pairs_per_s, 1e8, 2e6}};
  return trial;
}

/// a is exact and slow, d fast; b is as near as c and slower, e has no cost and no loss.
TradeoffReport small_report() {
  TradeoffReport report;
  report.job = "job";
  report.processor = "a processor";
  report.threads = 2;
  report.pairs = 1;
  report.reference = {GeneratorKind::kNetwork, "a"};
  report.trials = {trial_of("a", 2, 0), trial_of("b", 4, 0.02), trial_of("c", 5, 0.02),
                   trial_of("d", 40, 0.3), Trial{}};
  report.trials.back().configuration.computation.weights = "e";
  report.refused.push_back({{GeneratorKind::kNetwork, "f", Precision::kInt8}, "no calibration"});
  return report;
}

std::vector<TrialSummary> summaries(const TradeoffReport& report) {
  std::vector<TrialSummary> all;
  for (const Trial& trial : report.trials) all.push_back(summary_of(trial));
  return all;
}

TEST(TrialSummary, HasMediansOverTheRoundsAndRatiosWithinThem) {
  Trial trial = trial_of("a", 1, 0.1);
  // Conversion 2, 4, 9 s a pair; the machine is slower in the last round, and so is the reference.
  trial.rounds = {{1, 2, 4, 0.5, 100, 7}, {2, 4, 8, 0.25, 300, 7}, {3, 9, 27, 0.1, 200, 7}};
  const TrialSummary summary = summary_of(trial);
  EXPECT_EQ(summary.generator_s.median, 2);
  EXPECT_EQ(summary.conversion_s.median, 4);
  EXPECT_EQ(summary.conversion_s.low, 3);
  EXPECT_EQ(summary.conversion_s.high, 6.5);
  EXPECT_EQ(summary.speedup.median, 2);  // of 2, 2, 3
  EXPECT_EQ(summary.speedup.high, 2.5);
  EXPECT_EQ(summary.peak_bytes, 200);
  EXPECT_EQ(summary.stored_bytes, 7);
}

TEST(ParetoFront, HasWhatNothingElseBeatsByAHundredth) {
  EXPECT_THAT(pareto_front(summaries(small_report())), ElementsAre(0, 2, 3));
  EXPECT_TRUE(pareto_front({}).empty());
  TradeoffReport report;
  report.trials = {trial_of("a", 2, 0.1), trial_of("b", 2, 0.1)};
  EXPECT_THAT(pareto_front(summaries(report)), ElementsAre(0));
  report = TradeoffReport();
  report.trials = {trial_of("a", 2, 0.1), trial_of("b", 3, 0.1015), trial_of("c", 4, 0.102)};
  EXPECT_THAT(pareto_front(summaries(report)), ElementsAre(0, 2));  // from c on: b is as near
}

TEST(ParetoFront, GoesByProcessorTimeAndDemandsByPairsASecond) {
  TradeoffReport report;
  report.trials = {trial_of("a", 2, 0.1), trial_of("b", 1, 0.3)};
  report.trials[1].rounds[0].pairs_per_s = 7;  // the machine had more time for it
  const std::vector<TrialSummary> trials = summaries(report);
  EXPECT_THAT(pareto_front(trials), ElementsAre(0));
  EXPECT_EQ(best_trial(trials, {0.5, {}}), 0u);
  EXPECT_EQ(best_trial(trials, {{}, 5}), 1u);
}

TEST(BestTrial, IsTheFastestNearEnoughOrTheNearestFastEnough) {
  const std::vector<TrialSummary> trials = summaries(small_report());
  EXPECT_EQ(best_trial(trials, {0.03, {}}), 2u);
  EXPECT_EQ(best_trial(trials, {0.3, {}}), 3u);
  EXPECT_EQ(best_trial(trials, {0.01, {}}), 0u);
  EXPECT_EQ(best_trial(trials, {{}, 4}), 2u);
  EXPECT_EQ(best_trial(trials, {{}, 20}), 3u);
  EXPECT_EQ(best_trial(trials, {{}, 50}), std::nullopt);
  EXPECT_EQ(best_trial(trials, {0.03, 20}), std::nullopt);
  // Reference 0.5 s a pair, so that pairs/s are twice the times.
  EXPECT_EQ(best_trial(trials, {{}, {}, 2}), 2u);
  EXPECT_EQ(best_trial(trials, {{}, {}, 2.6}), 3u);
  EXPECT_EQ(best_trial(trials, {{}, {}, 21}), std::nullopt);
}

TEST(TradeoffText, HasTheFrontTheRefusalsAndTheLinesToPaste) {
  const std::string text = to_text(small_report(), {0.3, {}});
  EXPECT_THAT(text, HasSubstr("*  c float32 x1 float16"));
  EXPECT_THAT(text, HasSubstr("   b float32 x1 float16"));
  EXPECT_THAT(text, HasSubstr("not run: f int8 x1: no calibration"));
  EXPECT_THAT(text, HasSubstr("The fastest with an error of at most 0.3:\n    d float32"));
  EXPECT_THAT(text, HasSubstr("        \"generator\": {\"weights\":\"d\"},\n"
                              "        \"output\": {}\n"));
  EXPECT_THAT(to_text(small_report(), {{}, 50}),
              HasSubstr("The nearest with 50 pairs/s or more:\n    no configuration\n"));
  EXPECT_THAT(to_markdown(small_report(), {}), HasSubstr("| **c float32 x1 float16** |"));
}

TEST(TradeoffText, AlwaysRecommends) {
  // c is the fastest within 3 %, and at 2.5 times the nearest of those that are twice as fast.
  constexpr char kBoth[] =
      "\nThe fastest within 3 % of the reference:\n"
      "The nearest to the reference at twice its speed:\n"
      "    c float32 x1 float16\n    2.50 times its speed, 5.0 pairs/s, error 0.02\n"
      "        \"generator\": {\"weights\":\"c\"},\n        \"output\": {}\n";
  EXPECT_THAT(to_text(small_report(), {}), HasSubstr(kBoth));
  TradeoffReport report = small_report();
  report.trials.erase(report.trials.begin() + 2);  // then b, which is exactly twice as fast
  EXPECT_THAT(to_text(report, {}), HasSubstr("    b float32 x1 float16\n    2.00 times"));
  report.trials.erase(report.trials.begin() + 1);  // then a, and d
  EXPECT_THAT(to_text(report, {}), AllOf(HasSubstr("within 3 % of the reference:\n    a float32"),
                                         HasSubstr("at twice its speed:\n    d float32")));
  report.trials = {trial_of("near", 2, 0.04), trial_of("fast", 3, 0.5)};
  EXPECT_THAT(
      to_text(report, {}),
      AllOf(HasSubstr("None is within 3 % of the reference; the nearest:\n    near float32"),
            HasSubstr("None is twice as fast as the reference; the fastest:\n    fast float32")));
  EXPECT_THAT(to_markdown(report, {}), HasSubstr("the nearest:\n\n    near float32"));
  report.trials.clear();
  EXPECT_THAT(to_text(report, {}), HasSubstr("the fastest:\n    no configuration\n"));
}

TEST(TradeoffJson, SaysWhatIsNextToTheManifestsOwn) {
  TradeoffReport report = small_report();
  const auto recommended = [&](const std::string& reason) -> std::string {
    const auto json = nlohmann::json::parse(to_json(report, {}));
    for (const auto& entry : json["recommended"]) {
      if (entry["reason"] == reason) return std::string(entry["name"]).substr(0, 1);
    }
    return "none";
  };
  for (const auto& [own, faster, nearer] :
       std::vector<std::array<std::string, 3>>{{"a", "c", "none"},  // b is slower and no nearer
                                               {"b", "c", "a"},
                                               {"c", "d", "a"},
                                               {"d", "none", "c"}}) {
    report.own = {{GeneratorKind::kNetwork, own}, StoredType::kFloat16};
    EXPECT_EQ(recommended("The manifest's own"), own);
    EXPECT_EQ(recommended("The next faster"), faster) << own;
    EXPECT_EQ(recommended("The next nearer to the reference"), nearer) << own;
  }
  EXPECT_THAT(to_text(report, {}), HasSubstr("\nThe manifest's own:\n    d float32"));
  report.own.dtype = StoredType::kUint8;  // which is not compared
  EXPECT_EQ(recommended("The manifest's own"), "none");
}

TEST(TradeoffText, TheTableFitsInto80ColumnsWhateverTheNames) {
  TradeoffReport report = small_report();
  report.trials.push_back(trial_of(std::string(60, 'w') + ".safetensors", 1234.5, 0.00021));
  report.trials.push_back(trial_of("shipped:16", 0.1, 12345));
  for (Trial& trial : report.trials) trial.real["camera"].f1_time = 0.5;
  const std::string text = to_text(report, {});
  const std::string table = text.substr(0, text.find("Pareto front"));
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) {
    // The long name alone has a line for itself, the numbers in the one below.
    if (line.ends_with(".safetensors float32 x1 float16")) continue;
    EXPECT_LE(line.size(), 80u) << line;
  }
  EXPECT_THAT(table, HasSubstr("617.25   1234.5  0.00021"));
  EXPECT_THAT(table, HasSubstr("shipped:16 float32 x1 float16  "));
}

TEST(TradeoffJson, HasNullForWhatIsNotKnown) {
  const auto json = nlohmann::json::parse(to_json(small_report(), {0.03, {}}));
  EXPECT_THAT(json["front"],
              ElementsAre("a float32 x1 float16", "c float32 x1 float16", "d float32 x1 float16"));
  EXPECT_EQ(json["configurations"][1]["lost_in_labels"], 0.1);
  EXPECT_EQ(json["configurations"][1]["times_reference"]["median"], 2);
  EXPECT_TRUE(json["configurations"][4]["relative_l2"].is_null());
  EXPECT_EQ(json["answer"]["name"], "c float32 x1 float16");
  ASSERT_EQ(json["recommended"].size(), 2u);
  EXPECT_EQ(json["recommended"][1]["name"], "c float32 x1 float16");
  EXPECT_EQ(json["recommended"][1]["manifest"].size(), 2u);
  EXPECT_EQ(json["not_run"][0]["reason"], "no calibration");
}

TEST(TradeoffChart, NamesEachPointAndNumbersTheFront) {
  const std::string svg = tradeoff_chart(small_report());
  for (const char* name : {"a", "b", "c", "d"}) {
    EXPECT_THAT(svg, HasSubstr(std::string("<title>") + name + " float32 x1 float16: "));
  }
  EXPECT_THAT(svg, HasSubstr(">3. d float32 x1 float16: "));
  EXPECT_THAT(svg, HasSubstr(">3</text>"));
  EXPECT_THAT(svg, HasSubstr("not to a camera"));
}

TEST(TradeoffChart, IsDrawnAlsoOfOneAndOfNothing) {
  TradeoffReport report = small_report();
  report.trials.resize(1);
  EXPECT_THAT(tradeoff_chart(report), HasSubstr(" mark\""));
  report.trials.clear();
  EXPECT_THAT(tradeoff_chart(report), HasSubstr("nothing to show"));
}

}  // namespace
}  // namespace eventgan
