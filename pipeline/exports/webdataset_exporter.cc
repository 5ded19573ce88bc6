#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "manifests/documents/detail/json_text.h"
#include "pipeline/exports/detail/exporter.h"
#include "pipeline/runtime/threads.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/files/atomic_file.h"
#include "stages/exports/array_files.h"
#include "stages/shards/codec/volume_codec.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

// The shard's columns under their names (manifests/guides/shard_format.md), null for what is not
// known; a NaN becomes null by itself.

Json json_of(Point point) {
  return point == kMissingPoint ? Json() : Json::array({point.x, point.y});
}

Json json_of(const Rectangle& box) { return {box.left, box.top, box.right, box.bottom}; }

Json json_of(const Intrinsics& camera) {
  return {camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y};
}

Json json_of(const LensDistortion& lens) { return {lens.k1, lens.k2, lens.k3, lens.p1, lens.p2}; }

Json json_of(const std::array<double, 3>& place) { return place; }

/// A matrix of four columns as its rows.
Json json_of(const std::array<double, 12>& matrix) {
  Json rows = Json::array();
  for (std::size_t i = 0; i < matrix.size(); i += 4) {
    rows.push_back({matrix[i], matrix[i + 1], matrix[i + 2], matrix[i + 3]});
  }
  return rows;
}

template <class Value>
Json json_of(const std::optional<Value>& value) {
  return value ? json_of(*value) : Json();
}

/// What stands for "unknown" in the shard becomes null.
template <class Value>
Json unless(const Value& unknown, const Value& value) {
  return value == unknown ? Json() : Json(value);
}

Json box_json(const Box& box, const VolumeBox& in_volume, const std::vector<std::string>& names) {
  const Box unknown;
  return {{"class_id", box.class_id},
          {"class", names.at(static_cast<std::size_t>(box.class_id))},
          {"xyxy", json_of(in_volume.clipped)},
          {"xyxy_unclipped", json_of(in_volume.unclipped)},
          {"xyxy_source", json_of(box.xyxy)},
          {"truncation", unless(unknown.truncation, box.truncation)},
          {"occlusion", unless(unknown.occlusion, box.occlusion)},
          {"alpha", unless(unknown.alpha, box.alpha)},
          {"box3d", unless(unknown.box3d, box.box3d)},
          {"ignore", in_volume.ignore},
          {"ignore_source", box.ignore},
          {"track_id", unless(unknown.track_id, box.track_id)},
          {"difficulty", unless(unknown.difficulty, box.difficulty)}};
}

Json person_json(const Person& person, const VolumePerson& in_volume) {
  const Person unknown;
  Json joints = Json::array();
  Json joints_source = Json::array();
  Json visible = Json::array();
  for (std::size_t j = 0; j < person.joints.size(); ++j) {
    joints.push_back(json_of(in_volume.joints.at(j)));
    joints_source.push_back(json_of(person.joints[j].at));
    visible.push_back(unless(Joint().visible, person.joints[j].visible));
  }
  Json joints3d;
  for (const auto& joint : person.joints3d_mm) joints3d.push_back(json_of(joint));
  return {{"joints", joints},
          {"joints_source", joints_source},
          {"visible", visible},
          {"center", json_of(in_volume.center)},
          {"center_source", json_of(person.center)},
          {"scale", unless(unknown.scale, person.scale)},
          {"scale_volume", unless(unknown.scale, in_volume.scale)},
          {"head_box", json_of(in_volume.head_box)},
          {"head_box_source", json_of(person.head_box)},
          {"box", json_of(in_volume.box)},
          {"box_source", json_of(person.box)},
          {"joints3d_mm", joints3d},
          {"camera", json_of(in_volume.camera)},
          {"camera_source", json_of(person.camera)},
          {"camera_distortion", json_of(person.distortion)}};
}

std::string labels_json(const OutgoingSample& sample) {
  const ShardSample& labels = sample.labels;
  const FramePair& pair = labels.pair;
  const LabelSchema& schema = sample.reader.header().label_schema;
  const FrameRef unknown;
  const std::string none;
  const std::array<double, 6>& map = labels.source_to_volume;
  Json json = {{"sample_id", labels.sample_id},
               {"dataset", sample.source.dataset},
               {"split", sample.source.split},
               {"sequence", unless(none, labels.sequence)},
               {"prev_path", pair.previous.path},
               {"next_path", pair.next.path},
               {"prev_index", pair.previous.index},
               {"next_index", pair.next.index},
               {"prev_video_frame", unless(unknown.video_frame, pair.previous.video_frame)},
               {"next_video_frame", unless(unknown.video_frame, pair.next.video_frame)},
               {"gap_frames", pair.gap_frames},
               {"gap_s", pair.gap_s()},
               {"label_index", pair.label_index},
               {"label_position", pair.label_position},
               {"prev_time_s", pair.previous.time_s},
               {"next_time_s", pair.next.time_s},
               {"subject", unless(none, labels.origin.subject)},
               {"action", unless(none, labels.origin.action)},
               {"camera", unless(none, labels.origin.camera)},
               {"drive", unless(none, labels.origin.drive)},
               {"source_size", {labels.source_size.height, labels.source_size.width}},
               {"source_to_volume",
                Json::array({Json{map[0], map[1], map[2]}, Json{map[3], map[4], map[5]}})},
               {"projection", json_of(labels.labels.projection)},
               {"projection_source", json_of(labels.annotation.projection)}};
  if (sample.source.has_boxes()) {
    Json& boxes = json["boxes"] = Json::array();
    for (std::size_t i = 0; i < labels.annotation.boxes.size(); ++i) {
      boxes.push_back(
          box_json(labels.annotation.boxes[i], labels.labels.boxes[i], schema.class_names));
    }
  }
  if (sample.source.has_joints()) {
    json["joint_names"] = schema.joint_names;
    if (!schema.joint_aliases.empty()) json["joint_aliases"] = schema.joint_aliases;
    Json& persons = json["persons"] = Json::array();
    for (std::size_t i = 0; i < labels.annotation.persons.size(); ++i) {
      persons.push_back(person_json(labels.annotation.persons[i], labels.labels.persons[i]));
    }
  }
  return dump_json(json) + "\n";
}

const char* dtype_of(StoredType type) {
  switch (type) {
    case StoredType::kFloat32:
      return "<f4";
    case StoredType::kFloat16:
      return "<f2";
    case StoredType::kUint8:
      break;
  }
  return "|u1";
}

/// `volume` as the shard stores it, and its `scale`.
std::string volume_npz(const OutgoingSample& sample) {
  const ShardHeader& header = sample.reader.header();
  const VolumeShape& shape = header.volume;
  const std::size_t size_bytes = shape.value_count() * stored_size(header.dtype);
  const auto stored = decode_chunk(sample.reader.stored_chunk(sample.slot), header.dtype,
                                   header.deflate_level, size_bytes);
  if (!stored) {
    throw std::runtime_error("expected an intact volume, got a damaged one, in " + header.name +
                             " (" + sample.labels.sample_id + ")");
  }
  const std::vector<std::size_t> sides{static_cast<std::size_t>(shape.channels()),
                                       static_cast<std::size_t>(shape.size.height),
                                       static_cast<std::size_t>(shape.size.width)};
  return npz_file({{"volume", npy_file(dtype_of(header.dtype), sides, *stored)},
                   {"scale", npy_file("<f4", {}, std::vector<float>{sample.labels.scale})}});
}

/// SHARD.tar with NAME.npz and NAME.json.
class WebdatasetExporter : public Exporter {
 public:
  std::string settings() const override { return ""; }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    AtomicFile file(
        step.file(shard.outline.name.substr(0, shard.outline.name.rfind('.')) + ".tar"));
    file.create();
    // Some samples at a time: a shard may be large.
    constexpr std::size_t kAtOnce = 16;
    const auto count = static_cast<std::size_t>(reader.header().sample_count);
    for (std::size_t first = 0; first < count; first += kAtOnce) {
      work.check_stop();
      std::array<std::string, kAtOnce> members;
      for_each_index(std::min(kAtOnce, count - first), work.threads, [&](std::size_t i) {
        work.with_sample(shard, reader, static_cast<int>(first + i),
                         [&](const OutgoingSample& sample) {
                           members[i] = tar_member(sample.name + ".npz", volume_npz(sample)) +
                                        tar_member(sample.name + ".json", labels_json(sample));
                         });
      });
      for (const std::string& member : members) file.write(member);
    }
    file.write(tar_end());
    file.publish();
  }
};

}  // namespace

std::unique_ptr<Exporter> webdataset_exporter() { return std::make_unique<WebdatasetExporter>(); }

}  // namespace eventgan
