#include "pipeline/tradeoff/tradeoff_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "manifests/documents/json_text_internal.h"
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
        !(trials[i].pairs_per_s.median >= demand.at_least_speed.value_or(0))) {
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
    for (const Trial& trial : report.trials) trials.push_back(summary_of(trial));
    front = pareto_front(trials);
  }
  bool on_front(std::size_t trial) const { return std::ranges::count(front, trial) > 0; }

  std::vector<TrialSummary> trials;
  std::vector<std::size_t> front;
};

constexpr const char* kNotes[] = {
    "pairs/s: on all threads, reading included, writing the file (1 to 2 % of a pair) not, as busy "
    "as the machine was; times: the reference's processor time of a pair over its own, in the same "
    "round; the front goes by it. MB peak: of the "
    "whole program; MB stored: a pair's volume, compressed. Medians over the rounds, (the middle "
    "half).",
    "error: ‖V - R‖ / ‖R‖, R the reference's volume, median over the pairs; F1 and times: as "
    "realism has them, means over the pairs; lost: share of R's events in labelled boxes and near "
    "labelled joints that V does not have.",
    "Volumes of another size are laid on the reference's grid: each pixel takes the mean, by area, "
    "of those it covers. That keeps the events per pixel of every part of the picture, and so its "
    "events times the area of a pixel. A simulator's counts are divided by their 98th percentile "
    "and clipped first."};

std::string with_spread(const Spread& spread, double factor, int digits) {
  if (std::isnan(spread.median)) return "-";
  return fmt::format("{:.{}f} ({:.{}f}-{:.{}f})", factor * spread.median, digits,
                     factor * spread.low, digits, factor * spread.high, digits);
}

/// `text` for a number, "-" without meaning.
std::string score(double value) { return std::isnan(value) ? "-" : fmt::format("{:.3f}", value); }
std::string small(double value) { return std::isnan(value) ? "-" : fmt::format("{:.2g}", value); }

using Row = std::vector<std::string>;

std::vector<Row> table_of(const Digest& digest) {
  const bool has_real = std::ranges::any_of(
      digest.trials, [](const TrialSummary& trial) { return trial.real.has_value(); });
  std::vector<Row> rows{{"", "configuration", "pairs/s", "times", "ms a pair", "generator",
                         "MB peak", "MB stored", "error", "largest", "F1 voxels", "F1 over time",
                         "times corr.", "lost"}};
  if (has_real) {
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
    if (!has_real) continue;
    const RealismScores real = trial.real.value_or(mean_scores({}));
    row.insert(row.end(), {score(real.f1_raw), score(real.f1_time), score(real.time_correlation)});
  }
  return rows;
}

std::string head(const TradeoffReport& report) {
  std::size_t rounds = 0;
  for (const Trial& trial : report.trials) rounds = std::max(rounds, trial.rounds.size());
  return fmt::format("{}: {} pairs, {} rounds, {} threads, {}\nreference: {}, its cost with {}\n",
                     report.job, report.pairs, rounds, report.threads, report.processor,
                     name_of(report.reference), to_string(report.reference_dtype));
}

/// What was left out, and why: a line a reason.
std::vector<std::string> left_out(const TradeoffReport& report) {
  std::map<std::string, std::string> names;  // by reason
  for (const RefusedComputation& refused : report.refused) {
    std::string& list = names[refused.reason];
    list += (list.empty() ? "" : ", ") + name_of(refused.computation);
  }
  std::vector<std::string> lines;
  for (const auto& [reason, list] : names) lines.push_back("not run: " + list + ": " + reason);
  for (const std::string& pair : report.skipped) lines.push_back("skipped pair: " + pair);
  for (const Trial& trial : report.trials) {
    if (trial.quarantined == 0) continue;
    lines.push_back(fmt::format("{}: {} of {} pairs have no sound volume",
                                name_of(trial.configuration), trial.quarantined, report.pairs));
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

/// The answer to a demand, and its lines for the manifest.
std::vector<std::string> answer(const TradeoffReport& report, const Digest& digest,
                                const TradeoffDemand& demand) {
  if (!demand.at_most_error && !demand.at_least_speed) return {};
  const auto best = best_trial(digest.trials, demand);
  if (!best) return {"no configuration has " + demand_text(demand)};
  const TrialSummary& trial = digest.trials[*best];
  std::vector<std::string> lines{fmt::format(
      "With {}, {}: {} ({:.1f} pairs/s, error {:.2g}). For the manifest:", demand_text(demand),
      demand.at_most_error ? "the fastest" : "the nearest", trial.name, trial.pairs_per_s.median,
      trial.loss.relative_l2)};
  const std::vector<std::string>& keys = report.trials[*best].lines;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    lines.push_back("    " + keys[i] + (i + 1 < keys.size() ? "," : ""));
  }
  return lines;
}

}  // namespace

std::string to_text(const TradeoffReport& report, const TradeoffDemand& demand) {
  const Digest digest(report);
  const std::vector<Row> rows = table_of(digest);
  std::vector<std::size_t> widths(rows.front().size());
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text = head(report) + "\n";
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += i <= 1 ? fmt::format("{:{}}  ", row[i], widths[i])
                     : fmt::format("{:>{}}  ", row[i], widths[i]);
    }
    text.resize(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  text +=
      "\n* on the Pareto front: nothing measured is as fast and nearer to the reference (by 1 % of "
      "its error)\n";
  for (const char* note : kNotes) text += std::string(note) + "\n";
  for (const std::string& line : left_out(report)) text += line + "\n";
  for (const std::string& line : answer(report, digest, demand)) text += line + "\n";
  return text;
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
      "\nBold: on the Pareto front, nothing measured is as fast and nearer to the reference (by 1 "
      "% of its error).\n";
  for (const char* note : kNotes) text += "\n" + std::string(note) + "\n";
  for (const std::string& line : left_out(report)) text += "\n" + line + "\n";
  const std::vector<std::string> lines = answer(report, digest, demand);
  for (std::size_t i = 0; i < lines.size(); ++i) text += (i < 2 ? "\n" : "") + lines[i] + "\n";
  return text;
}

namespace {

nlohmann::json json_of(const Spread& spread) {
  return {{"median", spread.median}, {"low", spread.low}, {"high", spread.high}};
}

nlohmann::json json_of(const Trial& trial, const TrialSummary& summary, bool on_front) {
  const Computation& computation = trial.configuration.computation;
  const bool is_network = computation.method == GeneratorKind::kNetwork;
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
                         {"answer", nullptr}};
  for (std::size_t i = 0; i < report.trials.size(); ++i) {
    json["configurations"].push_back(
        json_of(report.trials[i], digest.trials[i], digest.on_front(i)));
  }
  for (const std::size_t i : digest.front) json["front"].push_back(digest.trials[i].name);
  for (const RefusedComputation& refused : report.refused) {
    json["not_run"].push_back({{"name", name_of(refused.computation)}, {"reason", refused.reason}});
  }
  if (demand.at_most_error || demand.at_least_speed) {
    if (const auto best = best_trial(digest.trials, demand)) {
      json["answer"] = {{"name", digest.trials[*best].name},
                        {"manifest", report.trials[*best].lines}};
    }
  }
  return dump_json(json, JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan
