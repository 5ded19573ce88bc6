#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <type_traits>

#include "manifests/strict_json/json_text_internal.h"
#include "stages/shards/shard_counts.h"
#include "stages/shards/shard_summary.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

Json json(const Point& p) { return {p.x, p.y}; }
Json json(const Rectangle& r) { return {r.left, r.top, r.right, r.bottom}; }
Json json(const ImageSize& size) { return {{"height", size.height}, {"width", size.width}}; }

Json json(const Intrinsics& camera) {
  return {{"focal_x", camera.focal_x},
          {"focal_y", camera.focal_y},
          {"centre_x", camera.centre_x},
          {"centre_y", camera.centre_y}};
}

Json json(const LensDistortion& lens) {
  return {{"k1", lens.k1}, {"k2", lens.k2}, {"k3", lens.k3}, {"p1", lens.p1}, {"p2", lens.p2}};
}

Json json(const std::array<double, 3>& place) { return place; }

template <class Value>
Json json(const std::optional<Value>& value) {
  return value ? json(*value) : Json();
}

Json json(const FrameRef& frame) {
  return {{"path", frame.path}, {"index", frame.index}, {"video_frame", frame.video_frame}};
}

template <class Key>
Json by_name(const std::map<Key, std::int64_t>& counts) {
  Json object = Json::object();
  for (const auto& [key, count] : counts) {
    if constexpr (std::is_integral_v<Key>) {
      object[std::to_string(key)] = count;
    } else {
      object[key] = count;
    }
  }
  return object;
}

Json json(const ShardHeader& header, const Box& box, const VolumeBox& mapped) {
  return {{"class", header.label_schema.class_names.at(static_cast<std::size_t>(box.class_id))},
          {"xyxy", json(mapped.clipped)},
          {"xyxy_unclipped", json(mapped.unclipped)},
          {"xyxy_source", json(box.xyxy)},
          {"truncation", box.truncation},
          {"occlusion", box.occlusion},
          {"alpha", box.alpha},
          {"box3d", box.box3d},
          {"ignore", mapped.ignore},
          {"ignore_source", box.ignore},
          {"track_id", box.track_id}};
}

Json json(const ShardHeader& header, const Person& person, const VolumePerson& mapped) {
  Json joints = Json::array();
  for (std::size_t j = 0; j < person.joints.size(); ++j) {
    joints.push_back({{"name", header.label_schema.joint_names.at(j)},
                      {"at", json(mapped.joints[j])},
                      {"at_source", json(person.joints[j].at)},
                      {"visible", person.joints[j].visible}});
  }
  Json joints3d = Json::array();
  for (const auto& joint : person.joints3d_mm) joints3d.push_back(json(joint));
  return {{"center", json(mapped.center)},
          {"center_source", json(person.center)},
          {"scale", person.scale},
          {"scale_volume", mapped.scale},
          {"head_box", json(mapped.head_box)},
          {"head_box_source", json(person.head_box)},
          {"camera", json(mapped.camera)},
          {"camera_source", json(person.camera)},
          {"camera_distortion", json(person.distortion)},
          {"joints", joints},
          {"joints3d_mm", joints3d}};
}

/// Annotations and paths need not be UTF-8, but JSON must be.
std::string text(const Json& json) { return dump_json(json, JsonLayout::kIndented) + "\n"; }

}  // namespace

std::string shard_json(const ShardReader& reader) {
  const ShardHeader& header = reader.header();
  const ShardCounts counts = count_shard(reader);
  return text({{"name", header.name},
               {"format", kShardFormat},
               {"format_version", kShardFormatVersion},
               {"dataset", header.dataset},
               {"split", header.split},
               {"samples", header.sample_count},
               {"valid", counts.valid},
               {"empty_volumes", counts.empty_volumes},
               {"quarantined", counts.quarantined},
               {"bins", header.volume.bins},
               {"size", json(header.volume.size)},
               {"dtype", to_string(header.dtype)},
               {"deflate_level", header.deflate_level},
               {"normalization", to_string(header.normalization)},
               {"gaps", by_name(counts.gaps)},
               {"boxes", counts.boxes},
               {"classes", by_name(counts.classes)},
               {"persons", counts.persons},
               {"class_names", header.label_schema.class_names},
               {"joint_names", header.label_schema.joint_names},
               {"preprocessing", header.preprocessing},
               {"generator", header.generator},
               {"weights_hash", header.weights_hash},
               {"plan_hash", header.plan_hash},
               {"program_version", header.program_version},
               {"manifest", header.manifest_text}});
}

std::string sample_json(const ShardReader& reader, int slot) {
  const ShardHeader& header = reader.header();
  const ShardSample sample = reader.sample(slot);
  Json boxes = Json::array();
  for (std::size_t i = 0; i < sample.annotation.boxes.size(); ++i) {
    boxes.push_back(json(header, sample.annotation.boxes[i], sample.labels.boxes[i]));
  }
  Json persons = Json::array();
  for (std::size_t i = 0; i < sample.annotation.persons.size(); ++i) {
    persons.push_back(json(header, sample.annotation.persons[i], sample.labels.persons[i]));
  }
  const VolumeStatistics& statistics = sample.statistics;
  return text({{"shard", header.name},
               {"slot", slot},
               {"sample_id", sample.sample_id},
               {"valid", sample.valid},
               {"sequence", sample.sequence},
               {"previous", json(sample.pair.previous)},
               {"next", json(sample.pair.next)},
               {"gap_frames", sample.pair.gap_frames},
               {"gap_s", sample.pair.gap_s()},
               {"label_index", sample.pair.label_index},
               {"label_position", sample.pair.label_position},
               {"source_size", json(sample.source_size)},
               {"source_to_volume", sample.source_to_volume},
               {"scale", sample.scale},
               {"statistics",
                {{"eta98", statistics.eta98},
                 {"max", statistics.max},
                 {"nonzero_fraction", statistics.nonzero_fraction},
                 {"sum_positive", statistics.sum_positive},
                 {"sum_negative", statistics.sum_negative},
                 {"flags", flag_names(statistics.flags)}}},
               {"original", sample.annotation.original},
               {"boxes", boxes},
               {"persons", persons}});
}

}  // namespace eventgan
