#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/plan.h"
#include "manifests/strict_json/json_text_internal.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {
namespace {

using nlohmann::json;

constexpr char kFormat[] = "eventgan-plan";
constexpr int kVersion = 1;
constexpr std::int64_t kMost = INT64_MAX;
constexpr int kLargestGap = 6;
constexpr int kLargestSide = 1 << 20;

std::string dump(const json& value) {
  // A path need not be UTF-8, but JSON must be; the plan would not find such a file again.
  try {
    return value.dump();
  } catch (const json::type_error&) {
    std::throw_with_nested(
        std::runtime_error("expected names in UTF-8, got other bytes, in " +
                           value.dump(-1, ' ', false, json::error_handler_t::replace)));
  }
}

// ---- Writing

json frame_json(const FrameRef& frame) {
  json result = {{"path", frame.path}, {"index", frame.index}};
  if (frame.video_frame >= 0) result["video_frame"] = frame.video_frame;
  if (std::isfinite(frame.time_s)) result["time_s"] = frame.time_s;
  return result;
}

json sample_json(const PlannedSample& sample) {
  json result = {{"id", sample.sample_id},
                 {"sequence", sample.sequence},
                 {"label", sample.label_key},
                 {"previous", frame_json(sample.pair.previous)},
                 {"next", frame_json(sample.pair.next)},
                 {"gap", sample.pair.gap_frames},
                 {"label_index", sample.pair.label_index},
                 {"label_position", sample.pair.label_position}};
  if (!sample.fault.empty()) result["fault"] = sample.fault;
  return result;
}

json source_json(const SourceSummary& source) {
  json gaps = json::array();
  for (const auto& [gap, pairs] : source.pairs_by_gap)
    gaps.push_back({{"gap", gap}, {"pairs", pairs}});
  return {{"labelled_frames", source.labelled_frames},
          {"pairs_by_gap", gaps},
          {"without_partner", source.without_partner},
          {"without_partner_ids", source.without_partner_ids},
          {"faults", source.faults},
          {"notes", source.notes}};
}

// ---- Reading

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

PlannedSample read_sample(const StrictValue& value) {
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

PlannedShard read_shard(const StrictValue& value, int sources) {
  PlannedShard shard;
  StrictObject object = value.object();
  shard.name = object.at("name").text("a file name ending in .h5", [](std::string_view name) {
    return name.size() > 3 && name.ends_with(".h5") && name.find('/') == name.npos;
  });
  shard.source = object.at("source").integer(0, std::max(sources - 1, 0));
  shard.volume_size.height = object.at("height").integer(1, kLargestSide);
  shard.volume_size.width = object.at("width").integer(1, kLargestSide);
  for (const StrictValue& sample : object.at("samples").elements(1)) {
    shard.samples.push_back(read_sample(sample));
  }
  object.finish();
  return shard;
}

std::vector<std::string> read_texts(const StrictValue& value) {
  std::vector<std::string> texts;
  for (const StrictValue& element : value.elements()) texts.push_back(element.text());
  return texts;
}

SourceSummary read_source(const StrictValue& value) {
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

Plan read_document(const json& document, FaultList& faults) {
  Plan plan;
  StrictObject object = StrictValue(document, faults).object();
  if (!object.has_format(kFormat, kVersion)) return plan;
  plan.name = object.at("name").text();
  plan.manifest_text = object.at("manifest").text();
  for (const auto& [field, value] : object.at("fingerprint").members())
    plan.fingerprint[field] = value.text();
  for (const StrictValue& source : object.at("sources").elements())
    plan.sources.push_back(read_source(source));
  const int sources = static_cast<int>(plan.sources.size());
  for (const StrictValue& shard : object.at("shards").elements())
    plan.shards.push_back(read_shard(shard, sources));
  object.finish();
  return plan;
}

}  // namespace

std::string to_json(const Plan& plan) {
  json sources = json::array();
  for (const SourceSummary& source : plan.sources) sources.push_back(source_json(source));
  std::string text = "{\"fingerprint\":" + dump(plan.fingerprint) +
                     ",\n\"format\":" + dump(kFormat) +
                     ",\n\"manifest\":" + dump(plan.manifest_text) +
                     ",\n\"name\":" + dump(plan.name) + ",\n\"shards\":[";
  const char* between_shards = "\n";
  for (const PlannedShard& shard : plan.shards) {
    text += between_shards + ("{\"height\":" + std::to_string(shard.volume_size.height)) +
            ",\"name\":" + dump(shard.name) + ",\"samples\":[";
    const char* between_samples = "\n";
    for (const PlannedSample& sample : shard.samples) {
      text += between_samples + dump(sample_json(sample));
      between_samples = ",\n";
    }
    text += "\n],\"source\":" + std::to_string(shard.source) +
            ",\"width\":" + std::to_string(shard.volume_size.width) + "}";
    between_shards = ",\n";
  }
  return text + "\n],\n\"sources\":" + dump(sources) +
         ",\n\"version\":" + std::to_string(kVersion) + "}\n";
}

Plan parse_plan(std::string_view text, const std::string& name) {
  Plan plan;
  FaultList faults(name);
  if (const auto document = parse_json_text(text, faults)) plan = read_document(*document, faults);
  if (!faults.empty()) throw std::runtime_error(faults.text());
  return plan;
}

}  // namespace eventgan
