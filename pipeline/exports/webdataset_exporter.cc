#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/atomic_file.h"
#include "manifests/values/outlines.h"
#include "manifests/values/text.h"
#include "pipeline/exports/detail/exporter.h"
#include "pipeline/runtime/threads.h"
#include "stages/base/archives/numpy_arrays.h"
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

Json json_of(const ImageMotion& motion) {
  return {motion.x_px, motion.y_px, motion.angle_deg, motion.scale};
}

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
          {"difficulty", unless(unknown.difficulty, box.difficulty)},
          {"outline",
           in_volume.outline.empty() ? Json() : Json::parse(outline_text(in_volume.outline))}};
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
               {"motion", json_of(pair.motion)},
               {"threshold", labels.threshold ? Json(*labels.threshold) : Json()},
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

std::string tar_name(const ExportShard& shard) {
  return shard.outline.name.substr(0, shard.outline.name.rfind('.')) + ".tar";
}

// README.md, a dataset card as the Hugging Face Hub reads it: YAML between two lines of ---, then
// Markdown.

/// Text that is not ours as it may be in a line of Markdown: nothing of it is taken for markup.
std::string markdown(const std::string& text) {
  std::string escaped;
  for (const char c : escape_controls(text)) {
    if (std::string_view("\\`*_[]<>|~&$").find(c) != std::string_view::npos) {
      escaped += '\\';
    }
    escaped += c;
  }
  return escaped;
}

/// Text between lines that it does not have.
std::string fenced(const std::string& text) {
  std::string fence = "```";
  while (text.find(fence) != text.npos) fence += '`';
  return fence + "\n" + text + (text.ends_with('\n') ? "" : "\n") + fence + "\n";
}

/// The Hub's classes of sizes.
const char* size_category(std::int64_t samples) {
  constexpr std::pair<std::int64_t, const char*> kCategories[] = {
      {1'000, "n<1K"},          {10'000, "1K<n<10K"},     {100'000, "10K<n<100K"},
      {1'000'000, "100K<n<1M"}, {10'000'000, "1M<n<10M"}, {100'000'000, "10M<n<100M"}};
  for (const auto& [limit, category] : kCategories) {
    if (samples < limit) return category;
  }
  return "100M<n<1B";
}

/// What a card counts, by split.
struct CardCounts {
  std::int64_t samples = 0;
  std::map<std::string, std::int64_t> boxes;  ///< by class
  std::int64_t boxes_to_ignore = 0;
  std::int64_t persons = 0;
};

/// The card of these shards; `counts` by split.
std::string card_text(const ExportWork& work, const std::vector<const ExportShard*>& shards,
                      const std::map<std::string, CardCounts>& counts) {
  const ExportInput& input = work.input;
  bool has_boxes = false;
  bool has_persons = false;
  std::map<int, std::pair<std::int64_t, std::int64_t>> of_source;  // valid, quarantined
  std::map<std::string, std::vector<std::string>> tars;            // by split
  std::int64_t samples = 0;
  for (const ExportShard* shard : shards) {
    const ExportSource& source = input.source_of(*shard);
    has_boxes |= source.has_boxes();
    has_persons |= source.has_joints();
    auto& [valid, quarantined] = of_source[shard->outline.source];
    valid += shard->valid;
    quarantined += std::ssize(shard->quarantined);
    samples += shard->valid;
    tars[source.split].push_back(tar_name(*shard));
  }
  const auto quoted = [](const std::string& text) { return dump_json(Json(text)); };
  std::string text =
      "---\nlicense: other\nlicense_name: to-be-filled-in\npretty_name: " + quoted(input.name()) +
      "\n";
  if (has_boxes || has_persons) text += "task_categories:\n";
  if (has_boxes) text += "- object-detection\n";
  if (has_persons) text += "- keypoint-detection\n";
  text += fmt::format("size_categories:\n- {}\ntags:\n- event-camera\n- webdataset\n- eventgan\n",
                      size_category(samples));
  text += "configs:\n- config_name: default\n  data_files:\n";
  for (const std::string& split : input.splits()) {
    if (!tars.contains(split)) continue;
    // The Hub's names of splits have no hyphens.
    std::string name = split;
    std::ranges::replace(name, '-', '_');
    text += "  - split: " + quoted(name) + "\n    path:\n";
    for (const std::string& tar : tars[split]) text += "    - " + quoted(tar) + "\n";
  }
  const ShardHeader header = input.open(*shards.front()).header();
  const std::string title = markdown(input.name());
  text += "---\n\n# " + title +
          "\n\nEvent volumes for event cameras, made from labelled frames by eventgan. "
          "`NAME.npz` is a sample's volume, `NAME.json` its labels.\n\n"
          "## Licence\n\n**To be filled in.** The labels, and the volumes that were made from the "
          "images, are subject to the licences of the sources below.\n\n"
          "## Sources\n\n| source | split | samples | quarantined samples, left out |\n"
          "|---|---|---|---|\n";
  for (const auto& [index, count] : of_source) {
    const ExportSource& source = input.sources().at(static_cast<std::size_t>(index));
    text += fmt::format("| {} | {} | {} | {} |\n", markdown(source.dataset), markdown(source.split),
                        count.first, count.second);
  }
  text += "\n## Counts\n\n| split | what | count |\n|---|---|---|\n";
  for (const auto& [split, count] : counts) {
    const auto row = [&, name = markdown(split)](const std::string& what, std::int64_t number) {
      text += fmt::format("| {} | {} | {} |\n", name, what, number);
    };
    row("samples", count.samples);
    for (const auto& [name, boxes] : count.boxes) row("boxes of class " + markdown(name), boxes);
    if (count.boxes_to_ignore > 0) row("boxes to ignore", count.boxes_to_ignore);
    if (count.persons > 0) row("persons with joints", count.persons);
  }
  if (!input.missing().empty()) {
    text +=
        "\n**Not complete**: without " + count_text(std::ssize(input.missing()), "shard") + ".\n";
  }
  const VolumeShape& shape = header.volume;
  text += fmt::format(
      "\n## How it was made\n\n| | |\n|---|---|\n| program | {} |\n| weights | {} |\n"
      "| SHA-256 of the weights, or of a simulator's settings | {} |\n| generator | {} |\n"
      "| volume, of the first shard | {} channels, {} x {} pixels |\n"
      "| SHA-256 of the plan | {} |\n\n"
      "The manifest (look through its paths before you share them):\n\n",
      markdown(header.program_version),
      header.weights.empty() ? "not named" : markdown(header.weights), header.weights_hash,
      markdown(header.generator), shape.channels(), shape.size.width, shape.size.height,
      header.plan_hash);
  return text + fenced(header.manifest_text);
}

/// SHARD.tar with NAME.npz and NAME.json, and README.md.
class WebdatasetExporter : public Exporter {
 public:
  WebdatasetExporter(const ExportInput&, const ExportOptions&) {}

  std::string settings() const override { return ""; }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    AtomicFile file(step.file(tar_name(shard)));
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

  void finish(const ExportWork& work,
              const std::vector<const ExportShard*>& shards) const override {
    const std::string input = fmt::format("{} {}", input_hash(shards), work.input.missing().size());
    ExportFolder::Step step(work.folder, "card", input);
    if (step.is_done()) return;
    std::map<std::string, CardCounts> counts;
    work.walk(shards, [&](const OutgoingSample& sample) {
      CardCounts& count = counts[sample.source.split];
      ++count.samples;
      const ShardSample& labels = sample.labels;
      for (std::size_t i = 0; i < labels.annotation.boxes.size(); ++i) {
        const auto class_id = static_cast<std::size_t>(labels.annotation.boxes[i].class_id);
        if (labels.labels.boxes.at(i).ignore) {
          ++count.boxes_to_ignore;
        } else {
          ++count.boxes[sample.source.class_names.at(class_id)];
        }
      }
      count.persons += std::ssize(labels.annotation.persons);
    });
    step.write("README.md", card_text(work, shards, counts));
    step.finish();
  }
};

}  // namespace

ExportFormat webdataset_format() {
  return {.word = "webdataset",
          .title = "tar files with a .npz and a .json for each sample, and a dataset card",
          .need = LabelNeed::kNone,
          .options = {},
          .files = {"SHARD.tar", "README.md"},
          .make = make_exporter<WebdatasetExporter>};
}

}  // namespace eventgan
