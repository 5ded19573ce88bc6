#include "stages/shards/shard_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/events.h"
#include "manifests/values/text.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/detail/shard_objects.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

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

/// Row `row` of a column, as text; empty if it has no value there.
template <class Element>
std::string row_text(const ColumnSpec& spec, const std::vector<Element>& column, std::size_t row) {
  if constexpr (std::is_same_v<Element, std::string>) {
    return column[row];
  } else if constexpr (std::is_floating_point_v<Element>) {
    const std::span numbers = std::span(column).subspan(row * spec.width(), spec.width());
    if (std::ranges::all_of(numbers, [](Element x) { return std::isnan(x); })) return "";
    return fmt::format("{}", fmt::join(numbers, " "));
  } else {
    return "";  // tiles: their share is told
  }
}

/// What not every shard has of its samples, under the columns' names.
void describe_optional(const ShardReader& reader, int slot, Lines& line) {
  visit_columns(reader.tables(), reader.header(), [&](const ColumnSpec& spec, const auto& column) {
    constexpr std::size_t kFew = 4;  // a matrix is for --json
    if (!spec.optional() || spec.rows != Rows::kSamples || column.empty()) return;
    if (spec.width() > kFew) return;
    const std::string text = row_text(spec, column, static_cast<std::size_t>(slot));
    const char* between = *spec.unit == '\0' ? "" : " ";
    if (!text.empty()) line.add(spec.name(), text + between + spec.unit);
  });
}

void describe_boxes(const ShardHeader& header, const ShardSample& sample, Lines& line) {
  for (std::size_t i = 0; i < sample.annotation.boxes.size(); ++i) {
    const Box& box = sample.annotation.boxes[i];
    const VolumeBox& mapped = sample.labels.boxes[i];
    std::size_t corners = 0;
    for (const auto& ring : mapped.outline.rings) corners += ring.size();
    line(fmt::format("box {}", i), "{} {}, source {}{}{}{}",
         header.label_schema.class_names.at(static_cast<std::size_t>(box.class_id)),
         text_of(mapped.clipped), text_of(box.xyxy),
         corners > 0 ? fmt::format(", outline of {} corners", corners) : "",
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

namespace {

/// Sums over a shard's samples. Boxes and persons count in quarantined samples too.
struct ShardCounts {
  int empty_volumes = 0;  ///< valid samples with kFlagEmpty
  std::int64_t boxes = 0;
  std::int64_t persons = 0;
  std::map<std::string, std::int64_t> classes;
  std::map<int, std::int64_t> gaps;
  std::vector<std::string> quarantined;  ///< sample ids in slot order

  explicit ShardCounts(const ShardReader& reader) {
    const ShardTables& tables = reader.tables();
    ShardContents contents = reader.contents();
    boxes = tables.boxes.offsets.back();
    persons = tables.poses.offsets.back();
    classes = std::move(contents.classes);
    gaps = std::move(contents.gaps);
    for (std::size_t i = 0; i < tables.valid.size(); ++i) {
      if (tables.valid[i] == 0) quarantined.push_back(tables.pairs.sample_id[i]);
      empty_volumes += tables.valid[i] != 0 && (tables.events.flags[i] & kFlagEmpty) != 0;
    }
  }
};

}  // namespace

std::string describe_shard(const ShardReader& reader) {
  const ShardHeader& header = reader.header();
  const ShardCounts counts(reader);
  const std::int64_t valid = header.sample_count - std::ssize(counts.quarantined);
  Lines line(header.name);
  line("format", "{} {}, written by {}", kShardFormat, header.format_version,
       header.program_version);
  line("dataset", "{}, split {}", header.dataset, header.split);
  line("samples", "{}, valid {}, without any event {}", header.sample_count, valid,
       counts.empty_volumes);
  if (!counts.quarantined.empty()) line("quarantined", "{}", fmt::join(counts.quarantined, ", "));
  line("volume", "2 polarities x {} bins, {} pixels, {}, deflate {}, normalization {}",
       header.volume.bins, to_string(header.volume.size), to_string(header.dtype),
       header.deflate_level, to_string(header.normalization));
  line("gaps", "{} (frames: samples)", counts_text(counts.gaps));
  line("boxes", "{}{}", counts.boxes,
       counts.boxes > 0 ? fmt::format(" ({})", counts_text(counts.classes)) : "");
  line("persons", "{} with joints", counts.persons);
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
  line("source size", "{} pixels", to_string(sample.source_size));
  if (sample.valid) {
    const VolumeStatistics& statistics = sample.statistics;
    line("volume", "largest {:g}, 98th percentile {:g}, non-zero {:g} %, sums +{:g} -{:g}",
         statistics.max, statistics.eta98, 100 * statistics.nonzero_fraction,
         statistics.sum_positive, statistics.sum_negative);
    if (statistics.flags != 0) line("flags", "{}", fmt::join(flag_names(statistics.flags), ", "));
  }
  describe_optional(reader, slot, line);
  line("original", "{} bytes", sample.annotation.original.size());
  describe_boxes(reader.header(), sample, line);
  describe_persons(reader.header(), sample, line);
  return line.text();
}

namespace {

using Json = nlohmann::ordered_json;

Json json(const ImageSize& size) { return {{"height", size.height}, {"width", size.width}}; }

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

/// `inner` dimensions of a row, nested.
template <class Element>
Json nested(std::span<const std::size_t> inner, std::span<const Element> elements) {
  if (inner.empty()) {
    if constexpr (std::is_same_v<Element, Half>) {
      return from_half(elements.front().bits);
    } else {
      return elements.front();
    }
  }
  Json list = Json::array();
  const std::size_t size = inner.front() == 0 ? 0 : elements.size() / inner.front();
  for (std::size_t i = 0; i < inner.front(); ++i) {
    list.push_back(nested(inner.subspan(1), elements.subspan(i * size, size)));
  }
  return list;
}

/// A row as it is stored; null if it is all NaN.
template <class Element>
Json row_json(const ColumnSpec& spec, const std::vector<Element>& column, std::size_t row) {
  if constexpr (std::is_same_v<Element, std::vector<char>>) {
    return std::string(column[row].begin(), column[row].end());
  } else {
    const std::span elements = std::span(column).subspan(row * spec.width(), spec.width());
    if constexpr (std::is_floating_point_v<Element>) {
      const auto is_nan = [](Element number) { return std::isnan(number); };
      if (!elements.empty() && std::ranges::all_of(elements, is_nan)) return nullptr;
    }
    if constexpr (std::is_same_v<Element, Half>) {
      const auto is_none = [](Half number) { return is_nan(number); };
      if (!elements.empty() && std::ranges::all_of(elements, is_none)) return nullptr;
    }
    return nested(std::span<const std::size_t>(spec.inner), std::span<const Element>(elements));
  }
}

/// Annotations and paths need not be UTF-8, but JSON must be.
std::string text(const Json& json) { return dump_json(json, JsonLayout::kIndented) + "\n"; }

}  // namespace

std::string shard_json(const ShardReader& reader) {
  const ShardHeader& header = reader.header();
  const ShardCounts counts(reader);
  return text({{"name", header.name},
               {"format", kShardFormat},
               {"format_version", header.format_version},
               {"dataset", header.dataset},
               {"split", header.split},
               {"samples", header.sample_count},
               {"valid", header.sample_count - std::ssize(counts.quarantined)},
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
  const ShardTables& tables = reader.tables();
  const ShardSample sample = reader.sample(slot);
  const auto index = static_cast<std::size_t>(slot);
  Json json = {{"shard", header.name}, {"slot", slot}};
  Json statistics;
  Json boxes = Json::array();
  Json persons = Json::array();
  visit_columns(tables, header, [&](const ColumnSpec& spec, const auto& column) {
    const std::string name(spec.name());
    const auto add_rows = [&](const std::vector<std::int64_t>& offsets, Json& list) {
      for (auto row = offsets[index]; row < offsets[index + 1] && !column.empty(); ++row) {
        list[static_cast<std::size_t>(row - offsets[index])][name] =
            row_json(spec, column, static_cast<std::size_t>(row));
      }
    };
    if (spec.rows == Rows::kBoxes) return add_rows(tables.boxes.offsets, boxes);
    if (spec.rows == Rows::kPersons) return add_rows(tables.poses.offsets, persons);
    if (spec.rows == Rows::kOffsets || column.empty()) return;
    const bool is_of_events = spec.group().starts_with("/events/");
    (is_of_events ? statistics : json)[name] = row_json(spec, column, index);
  });
  json["valid"] = sample.valid;
  statistics["flags"] = flag_names(sample.statistics.flags);
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const auto id = static_cast<std::size_t>(sample.annotation.boxes[i].class_id);
    boxes[i]["class"] = header.label_schema.class_names.at(id);
  }
  json["statistics"] = std::move(statistics);
  json["boxes"] = std::move(boxes);
  json["persons"] = std::move(persons);
  json["joint_names"] = header.label_schema.joint_names;
  return text(json);
}

}  // namespace eventgan
