#include "pipeline/realism/realism_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "manifests/documents/report.h"
#include "manifests/values/generators.h"
#include "manifests/values/text.h"
#include "stages/events/realism/realism_scores.h"

namespace eventgan {
namespace {

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

/// A method's mean, and its bounds, which are not told where they are not known.
struct Cell {
  double value = std::numeric_limits<double>::quiet_NaN();
  Bounds bounds;
};

std::string cell_text(const Cell& cell, bool best) {
  if (std::isnan(cell.value)) return fmt::format("{:>18} ", "-");
  const double half = (cell.bounds.high - cell.bounds.low) / 2;
  return fmt::format("{:>10.4f}{:<8} ", cell.value,
                     (best ? "*" : " ") + (std::isnan(half) ? "" : fmt::format("±{:.4f}", half)));
}

/// "label  symbol  real  method  method*": the real volume's own value (none for scores that
/// compare it with itself), then the methods', the best marked.
std::string table_row(const std::string& label, BetterScore better, std::optional<double> real,
                      const std::vector<Cell>& cells) {
  std::string text = fmt::format("{:28.28} {}", label, symbol(better));
  text += real ? cell_text({*real, {}}, false) : std::string(19, ' ');
  double least = std::numeric_limits<double>::infinity();
  for (const Cell& cell : cells) {
    const double distance = shortfall(better, cell.value, real.value_or(0));
    if (!std::isnan(distance)) least = std::min(least, distance);
  }
  for (const Cell& cell : cells) {
    text += cell_text(cell,
                      cells.size() > 1 && shortfall(better, cell.value, real.value_or(0)) == least);
  }
  while (text.back() == ' ') text.pop_back();
  return text + "\n";
}

/// What `cell_of` says of each method.
template <class CellOf>
std::vector<Cell> cells_of(const RealismReport& report, const CellOf& cell_of) {
  std::vector<Cell> cells;
  std::ranges::transform(report.methods, std::back_inserter(cells), cell_of);
  return cells;
}

std::vector<Cell> score_cells(const RealismReport& report, double RealismScores::*member) {
  return cells_of(report, [&](const MethodSummary& method) -> Cell {
    if (!method.bounds) return {method.mean.*member, {}};
    return {method.mean.*member, {method.bounds->low.*member, method.bounds->high.*member}};
  });
}

std::optional<double> real_value(const RealismReport& report, const ScoreRow& row) {
  if (row.better != BetterScore::kLikeReal) return std::nullopt;
  return report.real.mean.*row.member;
}

/// How far the methods' shares of the events by bin and polarity are from the camera's.
std::string share_row(const RealismReport& report, const std::string& label) {
  return table_row(label, BetterScore::kLower, std::nullopt,
                   cells_of(report, [&](const MethodSummary& method) -> Cell {
                     return {share_distance(method.mean, report.real.mean), {}};
                   }));
}

std::string bin_rows(const RealismReport& report) {
  std::string text;
  const std::vector<double> real = report.real.mean.events_per_bin();
  for (std::size_t bin = 0; bin < real.size(); ++bin) {
    text += table_row("  in bin " + std::to_string(bin), BetterScore::kLikeReal, real[bin],
                      cells_of(report, [&](const MethodSummary& method) -> Cell {
                        return {method.mean.events_per_bin()[bin], {}};
                      }));
  }
  return text + share_row(report, "  distance of shares");
}

constexpr const char* kDirectionLabel = "direction within 30 deg";

std::vector<Cell> direction_cells(const RealismReport& report) {
  return cells_of(report, [](const MethodSummary& method) -> Cell {
    return {direction_fraction(method.direction), method.direction_bounds};
  });
}

std::string direction_rows(const RealismReport& report) {
  if (!report.real.direction) return {};
  std::string pixels =
      fmt::format("{:28}  {:10}{:9}", "  pixels that tell it", report.real.direction->pixels, "");
  for (const MethodSummary& method : report.methods) {
    pixels += fmt::format("{:10}{:9}", method.direction ? method.direction->pixels : 0, "");
  }
  while (pixels.back() == ' ') pixels.pop_back();
  return table_row(kDirectionLabel, BetterScore::kHigher, direction_fraction(report.real.direction),
                   direction_cells(report)) +
         pixels + "\n";
}

std::string head(const RealismReport& report) {
  std::map<int, std::int64_t> by_gap;
  long long events = 0;
  for (const IntervalSummary& interval : report.intervals) {
    ++by_gap[interval.interval.gap()];
    events += interval.event_count;
  }
  std::string text =
      fmt::format("{}: {} pixels, {} of frames ({}), {}, {} bins\n", report.recording,
                  to_string(report.size), count_text(std::ssize(report.intervals), "pair"),
                  counts_text(by_gap, "gap "), count_text(events, "real event"), report.bins);
  for (const MethodSummary& method : report.methods) {
    text += fmt::format("  {}: {}\n", method.name, method.settings);
  }
  return text;
}

}  // namespace

double direction_fraction(const std::optional<DirectionScore>& direction) {
  return direction && direction->pixels > 0 ? direction->fraction()
                                            : std::numeric_limits<double>::quiet_NaN();
}

namespace {

std::string column_heads(const RealismReport& report) {
  std::string text = fmt::format("{:28}  {:>10}{:9}", "", "real", "");
  for (const MethodSummary& method : report.methods) {
    text += fmt::format("{:>10.10}{:9}", method.name, "");
  }
  while (text.back() == ' ') text.pop_back();
  return text + "\n";
}

std::string one_recording(const RealismReport& report) {
  std::string text;
  for (const ScoreRow& row : kScoreRows) {
    text +=
        table_row(row.label, row.better, real_value(report, row), score_cells(report, row.member));
    if (row.member == &RealismScores::events_per_pixel) text += bin_rows(report);
  }
  return text + direction_rows(report);
}

/// A method's means over the recordings, each counting alike.
RealismScores mean_over(std::span<const RealismReport> reports,
                        const std::function<const MethodSummary&(const RealismReport&)>& method) {
  std::vector<RealismScores> scores;
  for (const RealismReport& report : reports) {
    scores.push_back(method(report).mean);
    scores.back().events_per_channel.clear();  // of as many bins as the weights have
  }
  return mean_scores(scores);
}

/// A report whose methods have the means over the recordings.
RealismReport mean_report(std::span<const RealismReport> reports) {
  RealismReport mean;
  mean.recording = "mean";
  mean.real.name = "real";
  mean.real.mean = mean_over(
      reports, [](const RealismReport& r) -> const auto& { return r.real; });
  for (std::size_t i = 0; i < reports.front().methods.size(); ++i) {
    MethodSummary& method = mean.methods.emplace_back();
    method.name = reports.front().methods[i].name;
    method.mean = mean_over(
        reports, [i](const RealismReport& r) -> const auto& { return r.methods.at(i); });
  }
  return mean;
}

/// The end of a recording's path is what tells it from others.
std::string short_name(const std::string& recording) {
  constexpr std::size_t kRoom = 26;
  return recording.size() > kRoom ? "…" + recording.substr(recording.size() - kRoom + 1)
                                  : recording;
}

std::string several_recordings(std::span<const RealismReport> reports) {
  const RealismReport mean = mean_report(reports);
  std::string text;
  for (const ScoreRow& row : kScoreRows) {
    text += row.label + std::string(" ") + symbol(row.better) + "\n";
    for (const RealismReport& report : reports) {
      text += table_row("  " + short_name(report.recording), row.better, real_value(report, row),
                        score_cells(report, row.member));
    }
    text += table_row("  mean", row.better, real_value(mean, row), score_cells(mean, row.member));
  }
  text += "distance of shares by bin and polarity ↓\n";
  for (const RealismReport& report : reports) {
    text += share_row(report, "  " + short_name(report.recording));
  }
  std::string directions;
  for (const RealismReport& report : reports) {
    if (!report.real.direction) continue;
    directions += table_row("  " + short_name(report.recording), BetterScore::kHigher,
                            direction_fraction(report.real.direction), direction_cells(report));
  }
  if (!directions.empty()) text += kDirectionLabel + std::string(" ↑\n") + directions;
  return text;
}

/// The methods from the nearest to the camera on, and what follows from it.
std::string verdict_text(std::span<const RealismReport> reports) {
  const auto has_events = [](const RealismReport& report) {
    return std::ranges::any_of(
        report.intervals, [](const IntervalSummary& interval) { return interval.event_count > 0; });
  };
  if (std::ranges::none_of(reports, has_events)) {
    return "No event between the frames to compare with: are events and frames on one clock?\n";
  }
  const RealismReport mean = mean_report(reports);
  std::vector<const MethodSummary*> ranked;
  for (const MethodSummary& method : mean.methods) {
    if (!std::isnan(method.mean.f1_time)) ranked.push_back(&method);
  }
  if (ranked.size() < 2) return {};
  std::ranges::stable_sort(ranked, std::greater(),
                           [](const MethodSummary* method) { return method->mean.f1_time; });
  // What moves one frame does not know the motion between two.
  const auto moves_one_frame = [](const MethodSummary* method) {
    const auto row = std::ranges::find(kGenerators, method->name, &GeneratorRow::word);
    return row != kGenerators.end() && row->moves_one_frame;
  };
  const auto best = std::ranges::find_if_not(ranked, moves_one_frame);
  const auto for_stills = std::ranges::find_if(ranked, moves_one_frame);
  if (best == ranked.end()) return {};
  if (!((*best)->mean.f1_time > 0)) return {};
  return fmt::format(
      "By F1 summed over time: {}. For your own videos and sequences take \"{}\" as "
      "generator.kind.{}\n",
      joined(ranked, ", ",
             [](const MethodSummary* method) {
               return fmt::format("{} {:.3f}", method->name, method->mean.f1_time);
             }),
      (*best)->name,
      for_stills == ranked.end()
          ? ""
          : fmt::format(" {} is for photographs: it follows the motion that convert draws for "
                        "them, and does not know the motion between two frames, hence its F1 here.",
                        (*for_stills)->name));
}

}  // namespace

std::string to_text(std::span<const RealismReport> reports) {
  std::string text;
  for (const RealismReport& report : reports) text += head(report);
  text += column_heads(reports.front());
  text += reports.size() == 1 ? one_recording(reports.front()) : several_recordings(reports);
  return text +
         "↑ higher is better, ↓ lower is better, ≈ closer to the real one is better; * best. Means "
         "over the pairs of normalised volumes; ± half the width of the 95 % confidence interval "
         "(bootstrap over the pairs).\n" +
         verdict_text(reports);
}

namespace {

// The JSON library writes NaN as null.

nlohmann::json scores_json(const RealismScores& scores,
                           const std::optional<DirectionScore>& direction) {
  nlohmann::json json = nlohmann::json::object();
  for (const ScoreRow& row : kScoreRows) json[row.key] = scores.*row.member;
  json["events_per_channel"] = scores.events_per_channel;
  if (direction) {
    json["direction"] = {{"pixels", direction->pixels}, {"within_30_deg", direction->within}};
  }
  return json;
}

/// [low, high] by score.
nlohmann::json bounds_json(const MethodSummary& method) {
  if (!method.bounds) return nullptr;
  const ScoreBounds& bounds = *method.bounds;
  nlohmann::json json = nlohmann::json::object();
  for (const ScoreRow& row : kScoreRows) {
    json[row.key] = {bounds.low.*row.member, bounds.high.*row.member};
  }
  for (std::size_t i = 0; i < bounds.low.events_per_channel.size(); ++i) {
    json["events_per_channel"].push_back(
        {bounds.low.events_per_channel[i], bounds.high.events_per_channel[i]});
  }
  if (method.direction) {
    json["direction"] = {method.direction_bounds.low, method.direction_bounds.high};
  }
  return json;
}

nlohmann::json method_json(const MethodSummary& method, const RealismScores& real,
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
          {"share_distance", share_distance(method.mean, real)},
          {"bounds", bounds_json(method)},
          {"pairs", pairs}};
}

nlohmann::json report_json(const RealismReport& report) {
  const auto pair_json = [](const IntervalSummary& interval) -> nlohmann::json {
    return {{"first_frame", interval.interval.first},
            {"last_frame", interval.interval.last},
            {"gap", interval.interval.gap()},
            {"duration_s", interval.duration_s},
            {"events", interval.event_count}};
  };
  const auto scores_of = [&](const MethodSummary& method) {
    return method_json(method, report.real.mean, report.intervals);
  };
  return {{"recording", report.recording},
          {"height", report.size.height},
          {"width", report.size.width},
          {"bins", report.bins},
          {"seed", report.seed},
          {"pairs", json_list(report.intervals, pair_json)},
          {"real", scores_of(report.real)},
          {"methods", json_list(report.methods, scores_of)},
          {"wall_seconds", report.wall_seconds}};
}

}  // namespace

std::string to_json(std::span<const RealismReport> reports) {
  const RealismReport mean = mean_report(reports);
  nlohmann::json means = {{mean.real.name, scores_json(mean.real.mean, std::nullopt)}};
  for (const MethodSummary& method : mean.methods) {
    means[method.name] = scores_json(method.mean, std::nullopt);
  }
  const nlohmann::json json = {{"recordings", json_list(reports, report_json)}, {"mean", means}};
  return dump_json(json, JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan
