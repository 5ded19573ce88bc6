#include "pipeline/tradeoff/tradeoff_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/values/text.h"
#include "pipeline/realism/realism_report.h"

namespace eventgan {

TrialSummary summary_of(const Trial& trial) {
  const auto spread = [&](const auto& value_of) {
    std::vector<double> values;
    for (const RoundCost& round : trial.rounds) values.push_back(value_of(round));
    return spread_of(std::move(values));
  };
  TrialSummary summary;
  summary.name = name_of(trial.configuration);
  summary.generator_s = spread([](const RoundCost& round) { return round.generator_s; });
  summary.conversion_s = spread([](const RoundCost& round) { return round.conversion_s; });
  summary.pairs_per_s = spread([](const RoundCost& round) { return round.pairs_per_s; });
  summary.speedup =
      spread([](const RoundCost& round) { return round.reference_s / round.conversion_s; });
  summary.peak_bytes = spread([](const RoundCost& round) { return round.peak_bytes; }).median;
  summary.stored_bytes = spread([](const RoundCost& round) { return round.stored_bytes; }).median;
  summary.loss = overall_loss(trial.losses);
  if (trial.losses.empty()) summary.loss.relative_l2 = std::nan("");
  std::vector<RealismScores> real;
  for (const auto& [recording, scores] : trial.real) real.push_back(scores);
  if (!real.empty()) summary.real = mean_scores(real);
  return summary;
}

std::vector<std::size_t> pareto_front(const std::vector<TrialSummary>& trials) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const TrialSummary& trial = trials[i];
    if (!std::isnan(trial.speedup.median) && !std::isnan(trial.loss.relative_l2)) {
      order.push_back(i);
    }
  }
  // From the fastest on, only what is nearer than all that are faster.
  constexpr double kNearer = 0.99;  // of the error: less is no difference that anybody could use
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    if (trials[a].speedup.median != trials[b].speedup.median) {
      return trials[a].speedup.median > trials[b].speedup.median;
    }
    return trials[a].loss.relative_l2 < trials[b].loss.relative_l2;
  });
  std::vector<std::size_t> front;
  for (const std::size_t i : order) {
    if (front.empty() ||
        trials[i].loss.relative_l2 < kNearer * trials[front.back()].loss.relative_l2) {
      front.push_back(i);
    }
  }
  std::ranges::reverse(front);
  return front;
}

std::optional<std::size_t> best_trial(const std::vector<TrialSummary>& trials,
                                      const TradeoffDemand& demand) {
  std::optional<std::size_t> best;
  std::pair<double, double> best_rank;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const double error = trials[i].loss.relative_l2;
    const double speed = trials[i].speedup.median;
    // A NaN serves no demand.
    if (!(error <= demand.at_most_error.value_or(std::numeric_limits<double>::infinity())) ||
        !(trials[i].pairs_per_s.median >= demand.at_least_speed.value_or(0)) ||
        !(speed >= demand.at_least_times.value_or(0))) {
      continue;
    }
    const auto rank = demand.at_most_error ? std::pair(speed, -error) : std::pair(-error, speed);
    if (best && rank <= best_rank) continue;
    best = i;
    best_rank = rank;
  }
  return best;
}

namespace {

/// What all three forms of the report are made from.
struct Digest {
  explicit Digest(const TradeoffReport& report) {
    for (const Trial& trial : report.trials) {
      if (trial.configuration == report.own) own = trials.size();
      trials.push_back(summary_of(trial));
    }
    front = pareto_front(trials);
  }
  bool on_front(std::size_t trial) const { return std::ranges::count(front, trial) > 0; }
  bool has_real() const {
    return std::ranges::any_of(trials,
                               [](const TrialSummary& trial) { return trial.real.has_value(); });
  }

  std::vector<TrialSummary> trials;
  std::vector<std::size_t> front;
  std::optional<std::size_t> own;  ///< the manifest's
};

constexpr const char* kNotes[] = {
    "pairs/s: on all threads, with reading but without writing the file (1 to 2 % of a pair), "
    "under the machine's load at the time; times: the reference's processor time per pair divided "
    "by the configuration's, in the same round; the Pareto front uses it. MB peak: memory of the "
    "whole program; MB stored: one pair's compressed volume. Medians over the rounds (with the "
    "middle half).",
    "error: ‖V - R‖ / ‖R‖ with the reference's volume R, median over the pairs; F1 and times: as "
    "in realism, means over the pairs; lost: the share of R's events in labelled boxes and crops "
    "of persons that V lacks.",
    "Volumes of another size are resampled to the reference's grid by area: each pixel is the mean "
    "of the pixels it covers. That keeps the events per pixel in every part of the image. A "
    "simulator's counts are divided by their 98th percentile and clipped first."};

std::string with_spread(const Spread& spread, double factor, int digits) {
  if (std::isnan(spread.median)) return "-";
  return fmt::format("{:.{}f} ({:.{}f}-{:.{}f})", factor * spread.median, digits,
                     factor * spread.low, digits, factor * spread.high, digits);
}

/// A number as text, "-" without meaning.
std::string fixed(double value, int digits) {
  return std::isnan(value) ? "-" : fmt::format("{:.{}f}", value, digits);
}
std::string score(double value) { return fixed(value, 3); }
std::string small(double value) { return std::isnan(value) ? "-" : fmt::format("{:.2g}", value); }

using Row = std::vector<std::string>;

std::vector<Row> table_of(const Digest& digest) {
  std::vector<Row> rows{{"", "configuration", "pairs/s", "times", "ms a pair", "generator",
                         "MB peak", "MB stored", "error", "largest", "F1 voxels", "F1 over time",
                         "times corr.", "lost"}};
  if (digest.has_real()) {
    const Row more{"camera: F1 voxels", "F1 over time", "times corr."};
    rows.front().insert(rows.front().end(), more.begin(), more.end());
  }
  for (std::size_t i = 0; i < digest.trials.size(); ++i) {
    const TrialSummary& trial = digest.trials[i];
    Row& row = rows.emplace_back();
    row = {digest.on_front(i) ? "*" : "",
           trial.name,
           with_spread(trial.pairs_per_s, 1, 1),
           with_spread(trial.speedup, 1, 2),
           with_spread(trial.conversion_s, 1e3, 1),
           with_spread(trial.generator_s, 1e3, 1),
           trial.peak_bytes > 0 ? fmt::format("{:.0f}", 1e-6 * trial.peak_bytes) : "-",
           fmt::format("{:.3f}", 1e-6 * trial.stored_bytes),
           small(trial.loss.relative_l2),
           small(trial.loss.largest),
           score(trial.loss.f1_raw),
           score(trial.loss.f1_time),
           score(trial.loss.time_correlation),
           score(lost_share(trial.loss))};
    if (!digest.has_real()) continue;
    const RealismScores real = trial.real.value_or(mean_scores({}));
    row.insert(row.end(), {score(real.f1_raw), score(real.f1_time), score(real.time_correlation)});
  }
  return rows;
}

std::string head(const TradeoffReport& report) {
  std::size_t rounds = 0;
  for (const Trial& trial : report.trials) rounds = std::max(rounds, trial.rounds.size());
  return fmt::format("{}: {}, {}, {}\n{}\nreference: {}, its cost with {}\n", report.job,
                     count_text(report.pairs, "pair"),
                     count_text(static_cast<std::int64_t>(rounds), "round"),
                     count_text(report.threads, "thread"), report.processor,
                     name_of(report.reference), to_string(report.reference_dtype));
}

/// What was left out, and why: a line a reason.
std::vector<std::string> left_out(const TradeoffReport& report) {
  std::map<std::string, std::vector<std::string>> names;  // by reason
  for (const RefusedComputation& refused : report.refused) {
    names[refused.reason].push_back(name_of(refused.computation));
  }
  std::vector<std::string> lines;
  for (const auto& [reason, refused] : names) {
    lines.push_back(fmt::format("not run: {}: {}", fmt::join(refused, ", "), reason));
  }
  for (const std::string& pair : report.skipped) lines.push_back("skipped pair: " + pair);
  for (const Trial& trial : report.trials) {
    if (trial.quarantined == 0) continue;
    lines.push_back(fmt::format("{}: no valid volume for {} of {}", name_of(trial.configuration),
                                trial.quarantined, count_text(report.pairs, "pair")));
  }
  return lines;
}

std::string demand_text(const TradeoffDemand& demand) {
  std::string text;
  if (demand.at_most_error) text += fmt::format("an error of at most {:g}", *demand.at_most_error);
  if (!demand.at_least_speed) return text;
  return text +
         fmt::format("{}{:g} pairs/s or more", text.empty() ? "" : " and ", *demand.at_least_speed);
}

/// A question that a user has, and the trial that answers it.
struct Answer {
  std::string question;  ///< "The fastest within 3 % of the reference"
  std::optional<std::size_t> trial;
};

/// The manifest's own configuration, and what the front has next to it.
std::vector<Answer> around_own(const Digest& digest) {
  if (!digest.own) return {};
  const TrialSummary& own = digest.trials[*digest.own];
  std::optional<std::size_t> faster, nearer;
  for (const std::size_t i : digest.front) {  // from the slowest to the fastest
    const TrialSummary& trial = digest.trials[i];
    if (!faster && trial.speedup.median > own.speedup.median) faster = i;
    if (trial.loss.relative_l2 < own.loss.relative_l2) nearer = i;
  }
  std::vector<Answer> answers{{"The manifest's own", digest.own}};
  if (faster) answers.push_back({"The next faster", faster});
  if (nearer) answers.push_back({"The next nearer to the reference", nearer});
  return answers;
}

/// Measured against the reference.
std::vector<Answer> near_and_fast(const Digest& digest) {
  const auto best = [&](const TradeoffDemand& demand) { return best_trial(digest.trials, demand); };
  constexpr double kNear = 0.03, kFast = 2;
  std::vector<Answer> answers{
      {"The fastest within 3 % of the reference", best({.at_most_error = kNear})},
      {"The nearest to the reference at twice its speed", best({.at_least_times = kFast})}};
  if (!answers[0].trial) {
    answers[0] = {"None is within 3 % of the reference; the nearest", best({})};
  }
  if (!answers[1].trial) {
    answers[1] = {"None is twice as fast as the reference; the fastest",
                  best({.at_most_error = std::numeric_limits<double>::infinity()})};
  }
  return answers;
}

std::vector<Answer> recommendations(const Digest& digest) {
  std::vector<Answer> answers = around_own(digest);
  std::ranges::move(near_and_fast(digest), std::back_inserter(answers));
  return answers;
}

/// What is recommended, and what the user asked for.
std::vector<Answer> answers_of(const Digest& digest, const TradeoffDemand& demand) {
  std::vector<Answer> answers = recommendations(digest);
  if (demand.at_most_error || demand.at_least_speed) {
    answers.push_back(
        {(demand.at_most_error ? "The fastest with " : "The nearest with ") + demand_text(demand),
         best_trial(digest.trials, demand)});
  }
  return answers;
}

/// Answers with their lines for the manifest; `gap` is between question and answer.
std::string answers_text(const TradeoffReport& report, const Digest& digest,
                         const TradeoffDemand& demand, const char* gap) {
  const std::vector<Answer> answers = answers_of(digest, demand);
  std::string text;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const std::optional<std::size_t> best = answers[i].trial;
    const bool goes_on = i > 0 && best == answers[i - 1].trial;  // two questions, one answer
    text += (goes_on ? "" : "\n") + answers[i].question + ":\n";
    if (i + 1 < answers.size() && best == answers[i + 1].trial) continue;
    text += gap;
    if (!best) {
      text += "    no configuration\n";
      continue;
    }
    const TrialSummary& trial = digest.trials[*best];
    text += fmt::format("    {}\n    {:.2f} times its speed, {:.1f} pairs/s, error {:.2g}\n",
                        trial.name, trial.speedup.median, trial.pairs_per_s.median,
                        trial.loss.relative_l2);
    text += fmt::format("        {}\n", fmt::join(report.trials[*best].lines, ",\n        "));
  }
  return text;
}

}  // namespace

std::string to_text(const TradeoffReport& report, const TradeoffDemand& demand) {
  const Digest digest(report);
  const bool has_labels = std::ranges::any_of(
      digest.trials, [](const TrialSummary& trial) { return trial.loss.labelled_events > 0; });
  std::vector<Row> rows{{"", "configuration", "times", "pairs/s", "error", "MB"}};
  if (has_labels) rows.front().push_back("lost");
  if (digest.has_real()) rows.front().push_back("camera");
  for (std::size_t i = 0; i < digest.trials.size(); ++i) {
    const TrialSummary& trial = digest.trials[i];
    Row& row = rows.emplace_back();
    row = {digest.on_front(i) ? "*" : "",  trial.name,
           fixed(trial.speedup.median, 2), fixed(trial.pairs_per_s.median, 1),
           small(trial.loss.relative_l2),  fixed(1e-6 * trial.stored_bytes, 3)};
    if (has_labels) row.push_back(fixed(lost_share(trial.loss), 3));
    if (digest.has_real()) row.push_back(trial.real ? fixed(trial.real->f1_time, 3) : "-");
  }
  std::vector<std::size_t> widths(rows.front().size());
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  // A longer name has a line for itself.
  constexpr std::size_t kColumns = 80;
  const std::size_t others =
      std::accumulate(widths.begin() + 2, widths.end(), widths[0] + 2) + 2 * (widths.size() - 2);
  widths[1] = std::min(widths[1], kColumns - others);
  std::string text = head(report) + "\n";
  for (Row& row : rows) {
    if (row[1].size() > widths[1]) {
      text += fmt::format("{:{}}  {}\n", row[0], widths[0], row[1]);
      row[0].clear();
      row[1].clear();
    }
    text += fmt::format("{:{}}  {:{}}", row[0], widths[0], row[1], widths[1]);
    for (std::size_t i = 2; i < row.size(); ++i) text += fmt::format("  {:>{}}", row[i], widths[i]);
    text += "\n";
  }
  text +=
      "\n* Pareto front: nothing measured is as fast and closer to the reference.\ntimes: the "
      "speed relative to the reference. error: ‖V - R‖ / ‖R‖, the distance\nto the reference's "
      "volumes R, not to a camera. MB: one pair's compressed volume.\n";
  if (has_labels) text += "lost: the share of R's events at labels that V lacks.\n";
  if (digest.has_real()) text += "camera: F1 over time, against the camera's events.\n";
  for (const std::string& line : left_out(report)) text += line + "\n";
  return text + answers_text(report, digest, demand, "");
}

std::string to_markdown(const TradeoffReport& report, const TradeoffDemand& demand) {
  const Digest digest(report);
  const std::vector<Row> rows = table_of(digest);
  std::string text = "# " + head(report) + "\n";
  for (std::size_t r = 0; r < rows.size(); ++r) {
    text += "|";
    for (std::size_t i = 0; i < rows[r].size(); ++i) {
      const char* const mark = i == 1 && r > 0 && rows[r][0] == "*" ? "**" : "";
      if (i > 0) text += fmt::format(" {0}{1}{0} |", mark, rows[r][i]);
    }
    text += "\n";
    if (r > 0) continue;
    text += "| --- |";
    for (std::size_t i = 2; i < rows[r].size(); ++i) text += " ---: |";
    text += "\n";
  }
  text +=
      "\nBold: on the Pareto front: nothing measured is as fast and closer to the reference (by 1 "
      "% of its error).\n";
  for (const char* note : kNotes) text += "\n" + std::string(note) + "\n";
  for (const std::string& line : left_out(report)) text += "\n" + line + "\n";
  return text + answers_text(report, digest, demand, "\n");
}

namespace {

nlohmann::json json_of(const Spread& spread) {
  return {{"median", spread.median}, {"low", spread.low}, {"high", spread.high}};
}

nlohmann::json json_of(const Trial& trial, const TrialSummary& summary, bool on_front) {
  const Computation& computation = trial.configuration.computation;
  const bool is_network = has_weights(computation.method);
  nlohmann::json real = nlohmann::json::object();
  const auto add_real = [&](const std::string& name, const RealismScores& scores) {
    for (const ScoreRow& row : kScoreRows) real[name][row.key] = scores.*row.member;
  };
  for (const auto& [recording, scores] : trial.real) add_real(recording, scores);
  if (summary.real) add_real("mean", *summary.real);
  nlohmann::json json = {{"name", summary.name},
                         {"method", to_string(computation.method)},
                         {"size", computation.size},
                         {"dtype", to_string(trial.configuration.dtype)},
                         {"manifest", trial.lines},
                         {"on_front", on_front},
                         {"pairs", trial.losses.size()},
                         {"quarantined", trial.quarantined},
                         {"generator_s", json_of(summary.generator_s)},
                         {"conversion_s", json_of(summary.conversion_s)},
                         {"pairs_per_s", json_of(summary.pairs_per_s)},
                         {"times_reference", json_of(summary.speedup)},
                         {"peak_bytes", summary.peak_bytes},
                         {"stored_bytes", summary.stored_bytes},
                         {"relative_l2", summary.loss.relative_l2},
                         {"largest_error", summary.loss.largest},
                         {"f1_raw", summary.loss.f1_raw},
                         {"f1_time", summary.loss.f1_time},
                         {"time_correlation", summary.loss.time_correlation},
                         {"labelled_events", summary.loss.labelled_events},
                         {"lost_in_labels", lost_share(summary.loss)},
                         {"real", real}};
  if (is_network) {
    json["weights"] = computation.weights;
    json["precision"] = to_string(computation.precision);
    json["scope"] = to_string(computation.scope);
  }
  return json;
}

}  // namespace

std::string to_json(const TradeoffReport& report, const TradeoffDemand& demand) {
  const Digest digest(report);
  nlohmann::json json = {{"job", report.job},
                         {"processor", report.processor},
                         {"threads", report.threads},
                         {"pairs", report.pairs},
                         {"skipped", report.skipped},
                         {"reference", name_of(report.reference)},
                         {"reference_dtype", to_string(report.reference_dtype)},
                         {"notes", kNotes},
                         {"configurations", nlohmann::json::array()},
                         {"front", nlohmann::json::array()},
                         {"not_run", nlohmann::json::array()},
                         {"recommended", nlohmann::json::array()},
                         {"answer", nullptr}};
  for (std::size_t i = 0; i < report.trials.size(); ++i) {
    json["configurations"].push_back(
        json_of(report.trials[i], digest.trials[i], digest.on_front(i)));
  }
  for (const std::size_t i : digest.front) json["front"].push_back(digest.trials[i].name);
  for (const RefusedComputation& refused : report.refused) {
    json["not_run"].push_back({{"name", name_of(refused.computation)}, {"reason", refused.reason}});
  }
  const auto configuration = [&](std::size_t trial) {
    return nlohmann::json{{"name", digest.trials[trial].name},
                          {"manifest", report.trials[trial].lines}};
  };
  for (const Answer& answer : recommendations(digest)) {
    if (!answer.trial) continue;
    json["recommended"].push_back(configuration(*answer.trial));
    json["recommended"].back()["reason"] = answer.question;
  }
  if (demand.at_most_error || demand.at_least_speed) {
    if (const auto best = best_trial(digest.trials, demand)) json["answer"] = configuration(*best);
  }
  return dump_json(json, JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan
