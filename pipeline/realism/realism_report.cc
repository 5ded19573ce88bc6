#include "pipeline/realism/realism_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "manifests/documents/json_text_internal.h"
#include "stages/events/realism/realism_scores.h"

namespace eventgan {
namespace {

enum class BetterScore { kHigher, kLower, kLikeReal };

/// One score of RealismScores, as reports name it.
struct ScoreRow {
  const char* key;    ///< in JSON
  const char* label;  ///< in the table
  BetterScore better;
  double RealismScores::*member;
};

/// The polarity's correlation is a likeness too: the difference of log intensities has nearly 1 by
/// construction, and no camera has.
inline constexpr std::array<ScoreRow, 9> kScoreRows{{
    {"f1_raw", "F1, voxels", BetterScore::kHigher, &RealismScores::f1_raw},
    {"f1_time", "F1, summed over time", BetterScore::kHigher, &RealismScores::f1_time},
    {"f1_time_polarity", "F1, over time and polarity", BetterScore::kHigher,
     &RealismScores::f1_time_polarity},
    {"pool_mse_2", "PoolMSE 2", BetterScore::kLower, &RealismScores::pool_mse_2},
    {"pool_mse_4", "PoolMSE 4", BetterScore::kLower, &RealismScores::pool_mse_4},
    {"time_correlation", "correlation of mean times", BetterScore::kHigher,
     &RealismScores::time_correlation},
    {"polarity_correlation", "polarity ~ change of log I", BetterScore::kLikeReal,
     &RealismScores::polarity_correlation},
    {"events_per_pixel", "events per pixel", BetterScore::kLikeReal,
     &RealismScores::events_per_pixel},
    {"positive_share", "positive share", BetterScore::kLikeReal, &RealismScores::positive_share},
}};

const char* symbol(BetterScore better) {
  switch (better) {
    case BetterScore::kHigher:
      return "↑";
    case BetterScore::kLower:
      return "↓";
    case BetterScore::kLikeReal:
      break;
  }
  return "≈";
}

/// How far a value is from the best one could have; NaN if it has no meaning.
double shortfall(BetterScore better, double value, double real) {
  if (better == BetterScore::kHigher) return -value;
  return better == BetterScore::kLower ? value : std::abs(value - real);
}

/// "label  symbol  real  method  method*": the real volume's own value (none for scores that
/// compare it with itself), then the methods', the best marked.
std::string table_row(const std::string& label, BetterScore better, double real, bool show_real,
                      const std::vector<double>& values) {
  std::string text = fmt::format("{:28.28} {}", label, symbol(better));
  const auto cell = [](double value, bool best) {
    return std::isnan(value) ? fmt::format("{:>11} ", "-")
                             : fmt::format("{:11.4f}{}", value, best ? '*' : ' ');
  };
  text += show_real ? cell(real, false) : std::string(12, ' ');
  double least = std::numeric_limits<double>::infinity();
  for (const double value : values) {
    const double distance = shortfall(better, value, real);
    if (!std::isnan(distance)) least = std::min(least, distance);
  }
  for (const double value : values) {
    text += cell(value, values.size() > 1 && shortfall(better, value, real) == least);
  }
  return text + "\n";
}

std::vector<double> values_of(const RealismReport& report, double RealismScores::*member) {
  std::vector<double> values;
  for (const MethodSummary& method : report.methods) values.push_back(method.mean.*member);
  return values;
}

std::string bin_rows(const RealismReport& report) {
  std::string text;
  for (std::size_t bin = 0; bin < report.real.mean.events_per_bin.size(); ++bin) {
    std::vector<double> values;
    for (const MethodSummary& method : report.methods) {
      values.push_back(method.mean.events_per_bin[bin]);
    }
    text += table_row("  in bin " + std::to_string(bin), BetterScore::kLikeReal,
                      report.real.mean.events_per_bin[bin], true, values);
  }
  return text;
}

double fraction_of(const std::optional<DirectionScore>& direction) {
  return direction && direction->pixels > 0 ? direction->fraction()
                                            : std::numeric_limits<double>::quiet_NaN();
}

std::string direction_rows(const RealismReport& report) {
  if (!report.real.direction) return {};
  std::vector<double> values;
  std::string pixels =
      fmt::format("{:28}  {:11} ", "  pixels that tell it", report.real.direction->pixels);
  for (const MethodSummary& method : report.methods) {
    values.push_back(fraction_of(method.direction));
    pixels += fmt::format("{:11} ", method.direction ? method.direction->pixels : 0);
  }
  return table_row("direction within 30 deg", BetterScore::kHigher,
                   fraction_of(report.real.direction), true, values) +
         pixels + "\n";
}

std::string head(const RealismReport& report) {
  std::map<int, int> by_gap;
  long long events = 0;
  for (const IntervalSummary& interval : report.intervals) {
    ++by_gap[interval.interval.gap()];
    events += interval.event_count;
  }
  std::string text = fmt::format("{}: {}x{} pixels, {} pair{} of frames (", report.recording,
                                 report.size.width, report.size.height, report.intervals.size(),
                                 report.intervals.size() == 1 ? "" : "s");
  const char* separator = "";
  for (const auto& [gap, count] : by_gap) {
    text += fmt::format("{}gap {}: {}", separator, gap, count);
    separator = ", ";
  }
  text += fmt::format("), {} real events, {} bins\n", events, report.bins);
  for (const MethodSummary& method : report.methods) {
    text += fmt::format("  {}: {}\n", method.name, method.settings);
  }
  return text;
}

}  // namespace

std::string to_text(const RealismReport& report) {
  std::string text = head(report) + fmt::format("{:28}  {:>11} ", "", "real");
  for (const MethodSummary& method : report.methods) {
    text += fmt::format("{:>11.11} ", method.name);
  }
  text += "\n";
  for (const ScoreRow& row : kScoreRows) {
    text += table_row(row.label, row.better, report.real.mean.*row.member,
                      row.better == BetterScore::kLikeReal, values_of(report, row.member));
    if (row.member == &RealismScores::events_per_pixel) text += bin_rows(report);
  }
  text += direction_rows(report);
  text +=
      "↑ higher is better, ↓ lower, ≈ nearer to the real one; * best. Means over the pairs "
      "of normalised volumes.\n";
  return text;
}

namespace {

// The JSON library writes NaN as null.

nlohmann::json scores_json(const RealismScores& scores,
                           const std::optional<DirectionScore>& direction) {
  nlohmann::json json = nlohmann::json::object();
  for (const ScoreRow& row : kScoreRows) json[row.key] = scores.*row.member;
  json["events_per_bin"] = scores.events_per_bin;
  if (direction) {
    json["direction"] = {{"pixels", direction->pixels}, {"within_30_deg", direction->within}};
  }
  return json;
}

nlohmann::json method_json(const MethodSummary& method,
                           const std::vector<IntervalSummary>& intervals) {
  nlohmann::json pairs = nlohmann::json::array();
  for (std::size_t i = 0; i < method.intervals.size(); ++i) {
    const IntervalScores& scores = method.intervals[i];
    nlohmann::json pair = scores_json(scores.scores, scores.direction);
    pair["first_frame"] = intervals[i].interval.first;
    pair["last_frame"] = intervals[i].interval.last;
    pairs.push_back(std::move(pair));
  }
  return {{"name", method.name},
          {"settings", method.settings},
          {"mean", scores_json(method.mean, method.direction)},
          {"pairs", pairs}};
}

}  // namespace

std::string to_json(const RealismReport& report) {
  nlohmann::json pairs = nlohmann::json::array();
  for (const IntervalSummary& interval : report.intervals) {
    pairs.push_back({{"first_frame", interval.interval.first},
                     {"last_frame", interval.interval.last},
                     {"gap", interval.interval.gap()},
                     {"duration_s", interval.duration_s},
                     {"events", interval.event_count}});
  }
  nlohmann::json methods = nlohmann::json::array();
  for (const MethodSummary& method : report.methods) {
    methods.push_back(method_json(method, report.intervals));
  }
  const nlohmann::json json = {{"recording", report.recording},
                               {"height", report.size.height},
                               {"width", report.size.width},
                               {"bins", report.bins},
                               {"seed", report.seed},
                               {"pairs", pairs},
                               {"real", method_json(report.real, report.intervals)},
                               {"methods", methods},
                               {"wall_seconds", report.wall_seconds}};
  return dump_json(json, JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan
