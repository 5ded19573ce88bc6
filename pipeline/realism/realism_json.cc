#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_text_internal.h"
#include "pipeline/realism/realism_report.h"
#include "pipeline/realism/score_rows_internal.h"

namespace eventgan {
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
