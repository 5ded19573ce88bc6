#include <fmt/core.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/shards/shard_counts.h"
#include "stages/shards/shard_summary.h"

namespace eventgan {
namespace {

/// Lines "  name         value", values below each other.
class Lines {
 public:
  explicit Lines(const std::string& title) : text_(title + "\n") {}

  void add(std::string_view name, std::string_view value) {
    text_ += fmt::format("  {:14} {}\n", name, value);
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

std::string joined(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : ", ") + text;
  return all;
}

template <class Key>
std::string joined(const std::map<Key, std::int64_t>& counts) {
  std::string all;
  for (const auto& [key, count] : counts) {
    all += fmt::format("{}{}: {}", all.empty() ? "" : ", ", key, count);
  }
  return all;
}

std::string text_of(const ImageSize& size) {
  return fmt::format("{} x {} (height x width)", size.height, size.width);
}

std::string text_of(const Rectangle& r) {
  return fmt::format("[{:g} {:g} {:g} {:g}]", r.left, r.top, r.right, r.bottom);
}

std::string text_of(const Point& p) { return fmt::format("({:g} {:g})", p.x, p.y); }

std::string text_of(const FrameRef& frame) {
  const std::string text = fmt::format("{}, frame {}", frame.path, frame.index);
  if (frame.video_frame < 0) return text;
  return fmt::format("{} (frame {} of the video)", text, frame.video_frame);
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
  line("format", "{} {}, written by eventgan {}", kShardFormat, kShardFormatVersion,
       header.program_version);
  line("dataset", "{}, split {}", header.dataset, header.split);
  line("samples", "{}, valid {}, without any event {}", header.sample_count, counts.valid,
       counts.empty_volumes);
  if (!counts.quarantined.empty()) line.add("quarantined", joined(counts.quarantined));
  line("volume", "2 polarities x {} bins, {}, {}, deflate {}, normalization {}", header.volume.bins,
       text_of(header.volume.size), to_string(header.dtype), header.deflate_level,
       to_string(header.normalization));
  line("gaps", "{} (frames: samples)", joined(counts.gaps));
  line("boxes", "{}{}", counts.boxes,
       counts.boxes > 0 ? fmt::format(" ({})", joined(counts.classes)) : "");
  line("persons", "{}", counts.persons);
  if (!header.label_schema.joint_names.empty()) {
    line.add("joints", joined(header.label_schema.joint_names));
  }
  line.add("preprocessing", header.preprocessing);
  line.add("generator", header.generator);
  line.add("weights", header.weights_hash);
  line.add("plan", header.plan_hash);
  return line.text();
}

std::string describe_sample(const ShardReader& reader, int slot) {
  const ShardSample sample = reader.sample(slot);
  const FramePair& pair = sample.pair;
  Lines line(fmt::format("sample {} of {}", slot, reader.header().name));
  line("id", "{}, sequence {}", sample.sample_id, sample.sequence);
  line.add("valid", sample.valid ? "yes" : "no: quarantined, the marker beside the shard says why");
  line.add("previous", text_of(pair.previous));
  line.add("next", text_of(pair.next));
  line("gap", "{} frames{}", pair.gap_frames,
       std::isfinite(pair.gap_s()) ? fmt::format(", {:g} s", pair.gap_s()) : "");
  line("label", "frame {}, at {:g} of the way from previous to next", pair.label_index,
       pair.label_position);
  line.add("source size", text_of(sample.source_size));
  if (sample.valid) {
    const VolumeStatistics& statistics = sample.statistics;
    line("volume", "largest {:g}, 98th percentile {:g}, non-zero {:g} %, sums +{:g} -{:g}",
         statistics.max, statistics.eta98, 100 * statistics.nonzero_fraction,
         statistics.sum_positive, statistics.sum_negative);
    if (statistics.flags != 0) line.add("flags", joined(flag_names(statistics.flags)));
  }
  line("original", "{} bytes", sample.annotation.original.size());
  describe_boxes(reader.header(), sample, line);
  describe_persons(reader.header(), sample, line);
  return line.text();
}

}  // namespace eventgan
