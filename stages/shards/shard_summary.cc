#include "stages/shards/shard_summary.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/events.h"
#include "manifests/values/text.h"
#include "stages/shards/detail/shard_objects.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

ShardCounts count_shard(const ShardReader& reader) {
  const std::vector<std::string>& class_names = reader.header().label_schema.class_names;
  ShardCounts counts;
  for (int slot = 0; slot < reader.header().sample_count; ++slot) {
    const ShardSample sample = reader.sample(slot);
    counts.valid += sample.valid;
    counts.empty_volumes += sample.valid && (sample.statistics.flags & kFlagEmpty) != 0;
    if (!sample.valid) counts.quarantined.push_back(sample.sample_id);
    ++counts.gaps[sample.pair.gap_frames];
    counts.boxes += static_cast<std::int64_t>(sample.annotation.boxes.size());
    counts.persons += static_cast<std::int64_t>(sample.annotation.persons.size());
    for (const Box& box : sample.annotation.boxes) {
      ++counts.classes[class_names.at(static_cast<std::size_t>(box.class_id))];
    }
  }
  return counts;
}

std::vector<std::string> flag_names(std::uint32_t flags) {
  std::vector<std::string> names;
  if (flags & kFlagEmpty) names.emplace_back("empty");
  if (flags & kFlagExtrapolated) names.emplace_back("extrapolated");
  if (flags & kFlagSaturated) names.emplace_back("saturated");
  if (flags & kFlagVanished) names.emplace_back("vanished");
  if (flags & kFlagBeyondCalibration) names.emplace_back("beyond_calibration");
  if (flags & kFlagNoise) names.emplace_back("noise");
  return names;
}

namespace {

/// Lines "  name         value", values below each other. They are a file's, which may be
/// anybody's.
class Lines {
 public:
  explicit Lines(const std::string& title) : text_(escape_controls(title) + "\n") {}

  void add(std::string_view name, std::string_view value) {
    text_ += fmt::format("  {:14} {}\n", name, escape_controls(value));
  }

  template <class... Values>
  void operator()(std::string_view name, fmt::format_string<Values...> pattern,
                  Values&&... values) {
    add(name, fmt::format(pattern, std::forward<Values>(values)...));
  }

  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string text_of(const Rectangle& r) {
  return fmt::format("[{:g} {:g} {:g} {:g}]", r.left, r.top, r.right, r.bottom);
}

std::string text_of(const Point& p) { return fmt::format("({:g} {:g})", p.x, p.y); }

std::string text_of(const FrameRef& frame) {
  const std::string text = fmt::format("{}, frame {}", frame.path, frame.index);
  if (frame.video_frame < 0) return text;
  return fmt::format("{} (frame {} of the file)", text, frame.video_frame);
}

void describe_boxes(const ShardHeader& header, const ShardSample& sample, Lines& line) {
  for (std::size_t i = 0; i < sample.annotation.boxes.size(); ++i) {
    const Box& box = sample.annotation.boxes[i];
    const VolumeBox& mapped = sample.labels.boxes[i];
    line(fmt::format("box {}", i), "{} {}, source {}{}{}",
         header.label_schema.class_names.at(static_cast<std::size_t>(box.class_id)),
         text_of(mapped.clipped), text_of(box.xyxy),
         box.track_id >= 0 ? fmt::format(", track {}", box.track_id) : "",
         mapped.ignore ? ", ignore" : "");
  }
}

void describe_persons(const ShardHeader& header, const ShardSample& sample, Lines& line) {
  for (std::size_t i = 0; i < sample.annotation.persons.size(); ++i) {
    const Person& person = sample.annotation.persons[i];
    const VolumePerson& mapped = sample.labels.persons[i];
    line(fmt::format("person {}", i), "centre {}, scale {:g}{}", text_of(mapped.center),
         person.scale, mapped.head_box ? ", head " + text_of(*mapped.head_box) : "");
    for (std::size_t j = 0; j < mapped.joints.size(); ++j) {
      const Joint& joint = person.joints[j];
      if (joint.at == kMissingPoint) continue;
      line("", "{} {}, {}", header.label_schema.joint_names.at(j), text_of(mapped.joints[j]),
           joint.visible < 0   ? "visibility unknown"
           : joint.visible > 0 ? "visible"
                               : "hidden");
    }
  }
}

}  // namespace

std::string describe_shard(const ShardReader& reader) {
  const ShardHeader& header = reader.header();
  const ShardCounts counts = count_shard(reader);
  Lines line(header.name);
  line("format", "{} {}, written by {}", kShardFormat, header.format_version,
       header.program_version);
  line("dataset", "{}, split {}", header.dataset, header.split);
  line("samples", "{}, valid {}, without any event {}", header.sample_count, counts.valid,
       counts.empty_volumes);
  if (!counts.quarantined.empty()) line("quarantined", "{}", fmt::join(counts.quarantined, ", "));
  line("volume", "2 polarities x {} bins, {} pixels, {}, deflate {}, normalization {}",
       header.volume.bins, to_string(header.volume.size), to_string(header.dtype),
       header.deflate_level, to_string(header.normalization));
  line("gaps", "{} (frames: samples)", counts_text(counts.gaps));
  line("boxes", "{}{}", counts.boxes,
       counts.boxes > 0 ? fmt::format(" ({})", counts_text(counts.classes)) : "");
  line("persons", "{}", counts.persons);
  if (!header.label_schema.joint_names.empty()) {
    line("joints", "{}", fmt::join(header.label_schema.joint_names, ", "));
  }
  if (!header.features.empty()) line("features", "{}", fmt::join(header.features, ", "));
  line.add("preprocessing", header.preprocessing);
  line.add("generator", header.generator);
  line.add("weights", header.weights.empty() ? header.weights_hash
                                             : header.weights + ", " + header.weights_hash);
  line.add("plan", header.plan_hash);
  return line.text();
}

std::string describe_sample(const ShardReader& reader, int slot) {
  const ShardSample sample = reader.sample(slot);
  const FramePair& pair = sample.pair;
  Lines line(fmt::format("sample {} of {}", slot, reader.header().name));
  line("id", "{}{}{}", sample.sample_id, sample.sequence.empty() ? "" : ", sequence ",
       sample.sequence);
  line.add("valid",
           sample.valid ? "yes" : "no: quarantined, the commit record beside the shard says why");
  line.add("previous", text_of(pair.previous));
  line.add("next", text_of(pair.next));
  const bool is_window = pair.gap_frames == 0;  // of events
  const std::string seconds =
      std::isfinite(pair.gap_s()) ? fmt::format("{:g} s", pair.gap_s()) : "";
  line(is_window ? "window" : "gap", "{}{}{}",
       is_window ? "" : fmt::format("{} frames", pair.gap_frames),
       is_window || seconds.empty() ? "" : ", ", seconds);
  line("label", "frame {}, position {:g} (0 = previous frame, 1 = next frame)", pair.label_index,
       pair.label_position);
  if (const auto& motion = pair.motion) {
    line("motion", "of a still: ({:.4g} {:.4g}) px, {:.4g} degrees, scale {:.6g}", motion->x_px,
         motion->y_px, motion->angle_deg, motion->scale);
  }
  if (sample.threshold) line("threshold", "{:.4g} of the sensor", *sample.threshold);
  line("source size", "{} pixels", to_string(sample.source_size));
  if (sample.valid) {
    const VolumeStatistics& statistics = sample.statistics;
    line("volume", "largest {:g}, 98th percentile {:g}, non-zero {:g} %, sums +{:g} -{:g}",
         statistics.max, statistics.eta98, 100 * statistics.nonzero_fraction,
         statistics.sum_positive, statistics.sum_negative);
    if (!sample.tiles.empty())
      line("generated", "{:.3g} % of its tiles", 100 * generated_fraction(sample));
    if (statistics.flags != 0) line("flags", "{}", fmt::join(flag_names(statistics.flags), ", "));
  }
  line("original", "{} bytes", sample.annotation.original.size());
  describe_boxes(reader.header(), sample, line);
  describe_persons(reader.header(), sample, line);
  return line.text();
}

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

Json json(const ImageMotion& motion) {
  return {{"x_px", motion.x_px},
          {"y_px", motion.y_px},
          {"angle_deg", motion.angle_deg},
          {"scale", motion.scale}};
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
               {"format_version", header.format_version},
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
               {"weights", header.weights},
               {"weights_hash", header.weights_hash},
               {"features", header.features},
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
               {"motion", json(sample.pair.motion)},
               {"threshold", sample.threshold ? Json(*sample.threshold) : Json()},
               {"source_size", json(sample.source_size)},
               {"source_to_volume", sample.source_to_volume},
               {"scale", sample.scale},
               {"statistics",
                {{"eta98", statistics.eta98},
                 {"max", statistics.max},
                 {"nonzero_fraction", statistics.nonzero_fraction},
                 {"sum_positive", statistics.sum_positive},
                 {"sum_negative", statistics.sum_negative},
                 {"generated_fraction", generated_fraction(sample)},
                 {"flags", flag_names(statistics.flags)}}},
               {"original", sample.annotation.original},
               {"boxes", boxes},
               {"persons", persons}});
}

}  // namespace eventgan
