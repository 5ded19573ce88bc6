#include "pipeline/tradeoff/tradeoff_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "pipeline/tradeoff/kept_trials.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsNan;
using ::testing::Not;

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

TEST(ParetoFront, HasWhatNothingElseBeats) {
  EXPECT_THAT(pareto_front(summaries(small_report())), ElementsAre(0, 2, 3));
  EXPECT_TRUE(pareto_front({}).empty());
}

TEST(ParetoFront, OfEqualsHasTheFirst) {
  TradeoffReport report;
  report.trials = {trial_of("a", 2, 0.1), trial_of("b", 2, 0.1)};
  EXPECT_THAT(pareto_front(summaries(report)), ElementsAre(0));
}

TEST(ParetoFront, TakesAHundredthOfTheErrorForNoDifference) {
  TradeoffReport report;
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
}

TEST(TradeoffText, HasTheFrontTheRefusalsAndTheLinesToPaste) {
  const std::string text = to_text(small_report(), {0.03, {}});
  EXPECT_THAT(text, HasSubstr("*  c float32 x1 float16"));
  EXPECT_THAT(text, HasSubstr("   b float32 x1 float16"));
  EXPECT_THAT(text, HasSubstr("not run: f int8 x1: no calibration"));
  EXPECT_THAT(text, HasSubstr("    \"generator\": {\"weights\":\"c\"},\n    \"output\": {}\n"));
  EXPECT_THAT(to_text(small_report(), {{}, 50}),
              HasSubstr("no configuration has 50 pairs/s or more"));
  EXPECT_THAT(to_text(small_report(), {}), Not(HasSubstr("manifest")));
  EXPECT_THAT(to_markdown(small_report(), {}), HasSubstr("| **c float32 x1 float16** |"));
}

TEST(TradeoffJson, HasNullForWhatIsNotKnown) {
  const auto json = nlohmann::json::parse(to_json(small_report(), {0.03, {}}));
  EXPECT_THAT(json["front"],
              ElementsAre("a float32 x1 float16", "c float32 x1 float16", "d float32 x1 float16"));
  EXPECT_EQ(json["configurations"][1]["lost_in_labels"], 0.1);
  EXPECT_EQ(json["configurations"][1]["times_reference"]["median"], 2);
  EXPECT_TRUE(json["configurations"][4]["relative_l2"].is_null());
  EXPECT_EQ(json["answer"]["name"], "c float32 x1 float16");
  EXPECT_EQ(json["not_run"][0]["reason"], "no calibration");
}

TEST(TradeoffPicture, IsDrawnAlsoOfOneAndOfNothing) {
  const testing::TemporaryFolder folder;
  TradeoffReport report = small_report();
  while (true) {
    write_tradeoff_png(report, folder / "picture.png");
    EXPECT_GT(std::filesystem::file_size(folder / "picture.png"), 1000u);
    if (report.trials.empty()) break;
    report.trials.resize(report.trials.size() > 1 ? 1 : 0);
  }
}

TEST(KeptTrials, ComeBackUnderTheirKeyAlone) {
  const testing::TemporaryFolder folder;
  KeptTrials kept(folder.path());
  Trial trial = trial_of("a", 2, std::numeric_limits<double>::infinity());
  const std::vector<PairLoss> losses = std::exchange(trial.losses, {});
  const std::vector<RoundCost> rounds = std::exchange(trial.rounds, {});
  const std::string key(64, 'a');
  kept.load(trial, key);
  EXPECT_TRUE(trial.losses.empty());
  trial.losses = losses;
  trial.losses[0].time_correlation = std::numeric_limits<double>::quiet_NaN();
  trial.rounds = rounds;
  trial.quarantined = 3;
  trial.real["r.hdf5"].f1_raw = 0.25;
  kept.save(trial);

  Trial again;
  again.configuration = trial.configuration;
  kept.load(again, std::string(24, 'a') + std::string(40, 'b'));  // the same name, another key
  EXPECT_TRUE(again.losses.empty());
  kept.load(again, key);
  ASSERT_EQ(again.losses.size(), 1u);
  EXPECT_EQ(again.losses[0].relative_l2, std::numeric_limits<double>::infinity());
  EXPECT_THAT(again.losses[0].time_correlation, IsNan());
  EXPECT_EQ(again.losses[0].lost_events, 1);
  ASSERT_EQ(again.rounds.size(), 1u);
  EXPECT_EQ(again.rounds[0].pairs_per_s, 2);
  EXPECT_EQ(again.quarantined, 3);
  EXPECT_EQ(again.real.at("r.hdf5").f1_raw, 0.25);

  testing::write_file(folder.path() / "kept" / (key.substr(0, 24) + ".json"), "{\"key\": \"");
  Trial damaged;
  damaged.configuration = trial.configuration;
  kept.load(damaged, key);
  EXPECT_TRUE(damaged.losses.empty());
}

}  // namespace
}  // namespace eventgan
