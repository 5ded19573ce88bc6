#include <cmath>
#include <nlohmann/json.hpp>

#include "manifests/plan_parts_internal.h"
#include "manifests/strict_json/json_text_internal.h"

namespace eventgan {
namespace {

using nlohmann::json;

constexpr std::int64_t kMost = INT64_MAX;
constexpr int kLargestGap = 6;

json to_json_value(const FrameRef& frame) {
  json result = {{"path", frame.path}, {"index", frame.index}};
  if (frame.video_frame >= 0) result["video_frame"] = frame.video_frame;
  if (std::isfinite(frame.time_s)) result["time_s"] = frame.time_s;
  return result;
}

FrameRef read_frame(const StrictValue& value) {
  FrameRef frame;
  StrictObject object = value.object();
  frame.path = object.at("path").text();
  frame.index = object.at("index").integer<std::int64_t>(-kMost, kMost);
  if (const auto video = object.find("video_frame"))
    frame.video_frame = video->integer<std::int64_t>(0, kMost);
  if (const auto time = object.find("time_s")) frame.time_s = time->number(-1e18, 1e18);
  object.finish();
  return frame;
}

std::vector<std::string> read_texts(const StrictValue& value) {
  std::vector<std::string> texts;
  for (const StrictValue& element : value.elements()) texts.push_back(element.text());
  return texts;
}

/// A note may name files of any bytes, which are nobody's inputs: what is not UTF-8 is replaced.
json notes_as_json(const std::vector<std::string>& notes) {
  return json::parse(dump_json(json(notes)));
}

}  // namespace

json to_json_value(const PlannedSample& sample) {
  json result = {{"id", sample.sample_id},
                 {"sequence", sample.sequence},
                 {"label", sample.label_key},
                 {"previous", to_json_value(sample.pair.previous)},
                 {"next", to_json_value(sample.pair.next)},
                 {"gap", sample.pair.gap_frames},
                 {"label_index", sample.pair.label_index},
                 {"label_position", sample.pair.label_position}};
  if (!sample.fault.empty()) result["fault"] = sample.fault;
  return result;
}

PlannedSample read_planned_sample(const StrictValue& value) {
  PlannedSample sample;
  StrictObject object = value.object();
  sample.sample_id = object.at("id").text();
  sample.sequence = object.at("sequence").text();
  sample.label_key = object.at("label").text();
  sample.pair.previous = read_frame(object.at("previous"));
  sample.pair.next = read_frame(object.at("next"));
  sample.pair.gap_frames = object.at("gap").integer(1, kLargestGap);
  sample.pair.label_index = object.at("label_index").integer<std::int64_t>(-kMost, kMost);
  sample.pair.label_position = object.at("label_position").number(0, 1);
  if (const auto fault = object.find("fault")) sample.fault = fault->text();
  object.finish();
  return sample;
}

json to_json_value(const SourceSummary& source) {
  json gaps = json::array();
  for (const auto& [gap, pairs] : source.pairs_by_gap)
    gaps.push_back({{"gap", gap}, {"pairs", pairs}});
  return {{"labelled_frames", source.labelled_frames},
          {"pairs_by_gap", gaps},
          {"without_partner", source.without_partner},
          {"without_partner_ids", source.without_partner_ids},
          {"faults", source.faults},
          {"notes", notes_as_json(source.notes)}};
}

SourceSummary read_source_summary(const StrictValue& value) {
  SourceSummary source;
  StrictObject object = value.object();
  source.labelled_frames = object.at("labelled_frames").integer<std::int64_t>(0, kMost);
  for (const StrictValue& element : object.at("pairs_by_gap").elements()) {
    StrictObject entry = element.object();
    const int gap = entry.at("gap").integer(1, kLargestGap);
    source.pairs_by_gap[gap] = entry.at("pairs").integer<std::int64_t>(0, kMost);
    entry.finish();
  }
  source.without_partner = object.at("without_partner").integer<std::int64_t>(0, kMost);
  source.without_partner_ids = read_texts(object.at("without_partner_ids"));
  source.faults = object.at("faults").integer<std::int64_t>(0, kMost);
  source.notes = read_texts(object.at("notes"));
  object.finish();
  return source;
}

}  // namespace eventgan
