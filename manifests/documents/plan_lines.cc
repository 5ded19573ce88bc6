#include "manifests/documents/detail/plan_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <istream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/json_text.h"

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

json to_json_value(const ImageMotion& motion) {
  return {{"x_px", motion.x_px},
          {"y_px", motion.y_px},
          {"angle_deg", motion.angle_deg},
          {"scale", motion.scale}};
}

ImageMotion read_image_motion(const StrictValue& value) {
  constexpr double kFarthest_px = 1e6, kMost_deg = 360, kLeastScale = 1e-6, kMostScale = 1e6;
  ImageMotion motion;
  StrictObject object = value.object();
  motion.x_px = object.at("x_px").number(-kFarthest_px, kFarthest_px);
  motion.y_px = object.at("y_px").number(-kFarthest_px, kFarthest_px);
  motion.angle_deg = object.at("angle_deg").number(-kMost_deg, kMost_deg);
  motion.scale = object.at("scale").number(kLeastScale, kMostScale);
  object.finish();
  return motion;
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
  if (const auto& motion = sample.pair.motion) result["motion"] = to_json_value(*motion);
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
  sample.pair.gap_frames = object.at("gap").integer(0, kLargestGap);
  sample.pair.label_index = object.at("label_index").integer<std::int64_t>(-kMost, kMost);
  sample.pair.label_position = object.at("label_position").number(0, 1);
  if (const auto motion = object.find("motion")) sample.pair.motion = read_image_motion(*motion);
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
          {"unpaired", source.unpaired},
          {"unpaired_ids", source.unpaired_ids},
          {"faults", source.faults},
          {"notes", notes_as_json(source.notes)}};
}

SourceSummary read_source_summary(const StrictValue& value) {
  SourceSummary source;
  StrictObject object = value.object();
  source.labelled_frames = object.at("labelled_frames").integer<std::int64_t>(0, kMost);
  for (const StrictValue& element : object.at("pairs_by_gap").elements()) {
    StrictObject entry = element.object();
    const int gap = entry.at("gap").integer(0, kLargestGap);
    source.pairs_by_gap[gap] = entry.at("pairs").integer<std::int64_t>(0, kMost);
    entry.finish();
  }
  source.unpaired = object.at("unpaired").integer<std::int64_t>(0, kMost);
  source.unpaired_ids = read_texts(object.at("unpaired_ids"));
  source.faults = object.at("faults").integer<std::int64_t>(0, kMost);
  source.notes = read_texts(object.at("notes"));
  object.finish();
  return source;
}

namespace {

constexpr int kLargestPlannedSide = 1 << 20;

/// The lines of a document, each whole: with its line feed.
class Lines {
 public:
  Lines(std::istream& stream, const std::string& name) : stream_(stream), name_(name) { next(); }

  bool at_end() const { return at_end_; }
  std::string_view line() const { return line_; }

  void next() {
    ++number_;
    at_end_ = !std::getline(stream_, line_);
    if (!at_end_ && stream_.eof()) fail("a line feed at the end of the line");
  }

  /// From here on what is not known is named and passed over.
  void allow_unknown() { allows_unknown_ = true; }
  const std::set<std::string>& unknown() const { return unknown_; }

  /// Goes on to the line that begins with `begin`, over lines of keys that are not known.
  void pass_unknown(std::string_view begin) {
    while (allows_unknown_ && !at_end_ && line_.starts_with('"') && !line_.starts_with(begin)) {
      const std::size_t end = line_.find("\":");
      if (end == line_.npos || !line_.ends_with(',')) return;
      unknown_.insert(json_path("$", line_.substr(1, end - 1)));
      next();
    }
  }

  /// What is between `begin` and `end` in this line; goes on to the next.
  std::string take(std::string_view begin, std::string_view end) {
    if (begin.starts_with('"')) pass_unknown(begin);
    const std::string_view text = line_;
    if (at_end_ || text.size() < begin.size() + end.size() || !text.starts_with(begin) ||
        !text.ends_with(end)) {
      fail("a line " + std::string(begin) + "..." + std::string(end));
    }
    std::string inner(text.substr(begin.size(), text.size() - begin.size() - end.size()));
    next();
    return inner;
  }

  /// Goes on to the next line if this one is `expected`.
  void pass(const std::string& expected) {
    if (expected.starts_with('"')) pass_unknown(expected);
    if (at_end_ || line_ != expected) fail("the line " + expected);
    next();
  }

  /// Parses `text`, which ended on the line before this one, and gives it to `read`, which may add
  /// faults.
  template <class Read>
  auto parse(std::string_view text, const std::string& path, Read&& read) {
    return parse_of(number_ - 1, text, path, read);
  }

  /// The same for what is in this line.
  template <class Read>
  auto parse_here(std::string_view text, const std::string& path, Read&& read) {
    return parse_of(number_, text, path, read);
  }

  [[noreturn]] void fail(const std::string& expected) const {
    constexpr std::size_t kLongest = 60;
    const std::string got =
        at_end_ ? "the end of the file"
                : dump_json(nlohmann::json(line_.substr(0, kLongest)), JsonLayout::kAsciiLine);
    throw std::runtime_error(place(number_) + ": expected " + expected + ", got " + got);
  }

 private:
  std::string place(std::size_t number) const { return name_ + ":" + std::to_string(number); }

  template <class Read>
  auto parse_of(std::size_t number, std::string_view text, const std::string& path, Read&& read) {
    FaultList faults(place(number));
    if (allows_unknown_) faults.allow_unknown_keys();
    if (const auto document = parse_json_text(text, faults)) {
      auto result = read(StrictValue(*document, path, faults));
      unknown_.insert(faults.unknown_keys().begin(), faults.unknown_keys().end());
      if (faults.empty()) return result;
    }
    throw std::runtime_error(faults.text());
  }

  std::istream& stream_;
  const std::string& name_;
  std::string line_;
  std::size_t number_ = 0;  // of line_, from 1
  bool at_end_ = false;
  bool allows_unknown_ = false;
  std::set<std::string> unknown_;
};

std::string read_text(const StrictValue& value) { return value.text(); }

/// The first line.
void read_version(Lines& lines, const std::string& name) {
  const std::string begin = fmt::format("{{\"format\":\"{}\",\"version\":", kPlanFormat);
  const std::string stated = lines.parse(lines.take(begin, ","), "$.version", read_text);
  const auto version = readable_version(stated, kPlanVersion);
  if (!version) {
    throw UnreadableVersion(fmt::format(
        "expected a plan of version {}, got {}, in {}: it was written by another "
        "version of eventgan",
        readable_versions(kPlanVersion), dump_json(json(stated), JsonLayout::kAsciiLine), name));
  }
  if (version->minor > kPlanVersion.minor) lines.allow_unknown();
}

std::map<std::string, std::string> read_fingerprint(const StrictValue& value) {
  std::map<std::string, std::string> fingerprint;
  for (const auto& [field, text] : value.members()) fingerprint[field] = text.text();
  return fingerprint;
}

std::vector<SourceSummary> read_sources(const StrictValue& value) {
  std::vector<SourceSummary> sources;
  for (const StrictValue& source : value.elements()) sources.push_back(read_source_summary(source));
  return sources;
}

ShardOutline read_shard_outline(const StrictValue& value) {
  ShardOutline shard;
  StrictObject object = value.object();
  shard.name = object.at("name").text(kShardNameForm, is_shard_name);
  shard.source = object.at("source").integer(0, INT32_MAX);
  shard.volume_size.height = object.at("height").integer(1, kLargestPlannedSide);
  shard.volume_size.width = object.at("width").integer(1, kLargestPlannedSide);
  if (const auto unknown = object.find("size_unknown")) shard.size_unknown = unknown->boolean();
  object.finish();
  return shard;
}

/// Whether a comma says that another line like this one follows; `text` loses it.
bool take_comma(std::string_view& text) {
  const bool more = text.ends_with(',');
  if (more) text.remove_suffix(1);
  return more;
}

/// Samples up to and including the one without a comma; how many.
int read_samples(Lines& lines, const std::string& shard_path,
                 const std::function<void(const StrictValue&)>& take) {
  int count = 0;
  for (bool more = true; more; lines.next(), ++count) {
    std::string_view text = lines.line();
    more = take_comma(text);
    if (lines.at_end() || !text.starts_with("{\"") || !text.ends_with('}')) lines.fail("a sample");
    if (!take) continue;
    lines.parse_here(text, json_path(shard_path + ".samples", static_cast<std::size_t>(count)),
                     [&](const StrictValue& value) { return take(value), true; });
  }
  return count;
}

}  // namespace

PlanOutline read_plan_lines(
    std::istream& stream, const std::string& name,
    const std::function<void(std::size_t, const StrictValue&)>& take_sample) {
  PlanOutline plan;
  Lines lines(stream, name);
  read_version(lines, name);
  plan.fingerprint =
      lines.parse(lines.take("\"fingerprint\":", ","), "$.fingerprint", read_fingerprint);
  plan.manifest_text = lines.parse(lines.take("\"manifest\":", ","), "$.manifest", read_text);
  plan.name = lines.parse(lines.take("\"name\":", ","), "$.name", read_text);
  lines.pass("\"shards\":[");
  for (bool more = lines.line() != "],"; more;) {
    const std::size_t index = plan.shards.size();
    const std::string path = json_path("$.shards", index);
    const std::string head = lines.take("{", ",\"samples\":[");
    std::function<void(const StrictValue&)> take;
    if (take_sample) take = [&](const StrictValue& value) { take_sample(index, value); };
    const int samples = read_samples(lines, path, take);
    std::string_view tail = lines.line();
    more = take_comma(tail);
    const std::string rest = lines.take("],", more ? "}," : "}");
    ShardOutline shard = lines.parse("{" + head + "," + rest + "}", path, read_shard_outline);
    shard.samples = samples;
    plan.shards.push_back(std::move(shard));
  }
  lines.pass("],");
  plan.sources = lines.parse(lines.take("\"sources\":", "}"), "$.sources", read_sources);
  if (!lines.at_end()) lines.fail("the end of the file");
  plan.unknown = lines.unknown();

  const std::size_t sources = std::max<std::size_t>(plan.sources.size(), 1);
  for (const ShardOutline& shard : plan.shards) {
    if (static_cast<std::size_t>(shard.source) < sources) continue;
    throw std::runtime_error(name + ": expected a source 0.." + std::to_string(sources - 1) +
                             ", got " + std::to_string(shard.source) + ", for " + shard.name);
  }
  return plan;
}

}  // namespace eventgan
