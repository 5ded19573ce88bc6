#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <sstream>
#include <vector>

#include "stages/shards/shard_counts.h"
#include "stages/shards/shard_summary.h"

namespace eventgan {
namespace {

/// Lines "  name         value", values below each other.
class Lines {
 public:
  explicit Lines(const std::string& title) { out_ << title << '\n'; }

  std::ostream& operator()(const std::string& name) {
    out_ << (open_ ? "\n" : "") << "  " << name
         << std::string(15 - std::min<std::size_t>(name.size(), 14), ' ');
    open_ = true;
    return out_;
  }

  std::string text() { return out_.str() + (open_ ? "\n" : ""); }

 private:
  std::ostringstream out_;
  bool open_ = false;
};

std::string joined(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : ", ") + text;
  return all;
}

template <class Key>
std::string joined(const std::map<Key, std::int64_t>& counts) {
  std::ostringstream out;
  for (const auto& [key, count] : counts)
    out << (out.tellp() > 0 ? ", " : "") << key << ": " << count;
  return out.str();
}

std::ostream& operator<<(std::ostream& out, const ImageSize& size) {
  return out << size.height << " x " << size.width << " (height x width)";
}

std::ostream& operator<<(std::ostream& out, const Rectangle& r) {
  return out << '[' << r.left << ' ' << r.top << ' ' << r.right << ' ' << r.bottom << ']';
}

std::ostream& operator<<(std::ostream& out, const Point& p) {
  return out << '(' << p.x << ' ' << p.y << ')';
}

std::ostream& operator<<(std::ostream& out, const FrameRef& frame) {
  out << frame.path << ", frame " << frame.index;
  if (frame.video_frame >= 0) out << " (frame " << frame.video_frame << " of the video)";
  return out;
}

std::string visibility(int visible) {
  return visible < 0 ? "visibility unknown" : visible > 0 ? "visible" : "hidden";
}

void describe_boxes(const ShardHeader& header, const ShardSample& sample, Lines& line) {
  for (std::size_t i = 0; i < sample.annotation.boxes.size(); ++i) {
    const Box& box = sample.annotation.boxes[i];
    const VolumeBox& mapped = sample.labels.boxes[i];
    std::ostream& out = line("box " + std::to_string(i));
    out << header.label_schema.class_names.at(static_cast<std::size_t>(box.class_id)) << ' '
        << mapped.clipped << ", source " << box.xyxy;
    if (box.track_id >= 0) out << ", track " << box.track_id;
    if (mapped.ignore) out << ", ignore";
  }
}

void describe_persons(const ShardHeader& header, const ShardSample& sample, Lines& line) {
  for (std::size_t i = 0; i < sample.annotation.persons.size(); ++i) {
    const Person& person = sample.annotation.persons[i];
    const VolumePerson& mapped = sample.labels.persons[i];
    std::ostream& out = line("person " + std::to_string(i));
    out << "centre " << mapped.center << ", scale " << person.scale;
    if (mapped.head_box) out << ", head " << *mapped.head_box;
    for (std::size_t j = 0; j < mapped.joints.size(); ++j) {
      if (person.joints[j].at == kMissingPoint) continue;
      line("") << header.label_schema.joint_names.at(j) << ' ' << mapped.joints[j] << ", "
               << visibility(person.joints[j].visible);
    }
  }
}

}  // namespace

std::string describe_shard(const ShardReader& reader) {
  const ShardHeader& header = reader.header();
  const ShardCounts counts = count_shard(reader);
  Lines line(header.name);
  line("format") << kShardFormat << ' ' << kShardFormatVersion << ", written by eventgan "
                 << header.program_version;
  line("dataset") << header.dataset << ", split " << header.split;
  line("samples") << header.sample_count << ", valid " << counts.valid << ", without any event "
                  << counts.empty_volumes;
  if (!counts.quarantined.empty()) line("quarantined") << joined(counts.quarantined);
  line("volume") << "2 polarities x " << header.volume.bins << " bins, " << header.volume.size
                 << ", " << to_string(header.dtype) << ", deflate " << header.deflate_level
                 << ", normalization " << to_string(header.normalization);
  line("gaps") << joined(counts.gaps) << " (frames: samples)";
  line("boxes") << counts.boxes << (counts.boxes > 0 ? " (" + joined(counts.classes) + ")" : "");
  line("persons") << counts.persons;
  if (!header.label_schema.joint_names.empty()) {
    line("joints") << joined(header.label_schema.joint_names);
  }
  line("preprocessing") << header.preprocessing;
  line("generator") << header.generator;
  line("weights") << header.weights_hash;
  line("plan") << header.plan_hash;
  return line.text();
}

std::string describe_sample(const ShardReader& reader, int slot) {
  const ShardSample sample = reader.sample(slot);
  const FramePair& pair = sample.pair;
  Lines line("sample " + std::to_string(slot) + " of " + reader.header().name);
  line("id") << sample.sample_id << ", sequence " << sample.sequence;
  line("valid") << (sample.valid ? "yes" : "no: quarantined, the marker beside the shard says why");
  line("previous") << pair.previous;
  line("next") << pair.next;
  std::ostream& gap = line("gap");
  gap << pair.gap_frames << " frames";
  if (std::isfinite(pair.gap_s())) gap << ", " << pair.gap_s() << " s";
  line("label") << "frame " << pair.label_index << ", at " << pair.label_position
                << " of the way from previous to next";
  line("source size") << sample.source_size;
  if (sample.valid) {
    const VolumeStatistics& statistics = sample.statistics;
    line("volume") << "largest " << statistics.max << ", 98th percentile " << statistics.eta98
                   << ", non-zero " << 100 * statistics.nonzero_fraction << " %, sums +"
                   << statistics.sum_positive << " -" << statistics.sum_negative;
    if (statistics.flags != 0) line("flags") << joined(flag_names(statistics.flags));
  }
  line("original") << sample.annotation.original.size() << " bytes";
  describe_boxes(reader.header(), sample, line);
  describe_persons(reader.header(), sample, line);
  return line.text();
}

}  // namespace eventgan
