#include "manifests/documents/commit_record.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/documents/detail/manifest_file.h"
#include "manifests/documents/json_text.h"
#include "manifests/documents/strict_json.h"

namespace eventgan {
namespace {

constexpr char kCommitRecordFormat[] = "eventgan-commit-record";
constexpr FormatVersion kCommitRecordVersion{1, 0};
constexpr int kMostGap = 6;
constexpr double kMostSeconds = 1e12;

/// Cuts `ending` off the end of `text`; false if it has another.
bool take_end(std::string_view& text, std::string_view ending) {
  if (!text.ends_with(ending)) return false;
  text.remove_suffix(ending.size());
  return true;
}

/// Cuts a number off the end of `text`, as a plan writes it; false if there is none.
bool take_number(std::string_view& text) {
  constexpr std::size_t kFewestDigits = 5;
  const std::size_t rest = text.find_last_not_of("0123456789") + 1;  // 0 if it is digits alone
  const bool is_long = text.size() - rest >= kFewestDigits;
  text = text.substr(0, rest);
  return is_long;
}

std::string read_hash(const StrictValue& value) {
  return value.text("a SHA-256 of 64 digits 0-9a-f", [](std::string_view text) {
    return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == text.npos;
  });
}

std::vector<QuarantinedSample> read_quarantined(const StrictValue& value, int samples) {
  std::vector<QuarantinedSample> quarantined;
  for (const StrictValue& element : value.elements()) {
    StrictObject object = element.object();
    const StrictValue slot = object.at("slot");
    const auto number = slot.sound_integer(0, std::max(samples - 1, 0));
    if (number && !quarantined.empty() && *number <= quarantined.back().slot) {
      slot.fault("slots in ascending order");
    }
    quarantined.push_back({static_cast<int>(number.value_or(-1)), object.at("sample_id").text(),
                           object.at("reason").text()});
    object.finish();
  }
  return quarantined;
}

/// Numbers of rows, one for each sample.
std::vector<std::int32_t> read_row_counts(const StrictValue& value, int samples,
                                          const FaultList& faults) {
  std::vector<std::int32_t> counts;
  for (const StrictValue& element : value.elements())
    counts.push_back(element.integer<std::int32_t>(0, INT32_MAX));
  if (faults.empty() && std::ssize(counts) != samples) {
    value.fault("an array of " + std::to_string(samples) + " (a number for each sample)");
  }
  return counts;
}

std::map<int, std::int64_t> read_gaps(const StrictValue& value, int samples) {
  std::map<int, std::int64_t> gaps;
  for (const StrictValue& element : value.elements()) {
    StrictObject object = element.object();
    const StrictValue gap = object.at("gap");
    const auto number = gap.sound_integer(0, kMostGap);
    if (number && !gaps.empty() && *number <= gaps.rbegin()->first) {
      gap.fault("gaps in ascending order");
    }
    const int count = object.at("samples").integer(1, std::max(samples, 1));
    if (number) gaps[static_cast<int>(*number)] = count;
    object.finish();
  }
  return gaps;
}

LabelLosses::Reasons read_reasons(const StrictValue& value) {
  StrictObject object = value.object();
  LabelLosses::Reasons reasons;
  reasons.count = object.at("count").integer<std::int64_t>(0, INT64_MAX);
  const StrictValue first = object.at("first");
  for (const StrictValue& element : first.elements()) reasons.first.push_back(element.text());
  object.finish();
  if (value.faults().empty() && std::ssize(reasons.first) > reasons.count) {
    first.fault("an array of at most " + std::to_string(reasons.count) + " (a reason each)");
  }
  return reasons;
}

nlohmann::json json_of(const LabelLosses::Reasons& reasons) {
  return {{"count", reasons.count}, {"first", reasons.first}};
}

void require_seconds(double seconds, const std::string& of) {
  if (seconds >= 0 && seconds <= kMostSeconds) return;  // false for NaN
  throw std::invalid_argument("expected seconds of 0 or more, got " + std::to_string(seconds) +
                              ", for " + of);
}

/// Canonical JSON of a commit record: two-space indent, except that an array of numbers is on one
/// line, however long it is.
std::string indented(const nlohmann::json& object) {
  std::string text = "{";
  for (const auto& [key, value] : object.items()) {
    const bool on_one_line = value.is_array() && !value.empty() && value[0].is_number();
    text += (text.size() == 1 ? "\n  " : ",\n  ") + nlohmann::json(key).dump() + ": ";
    for (const char c : dump_json(value, on_one_line ? JsonLayout::kLine : JsonLayout::kIndented)) {
      text += c;
      if (c == '\n') text += "  ";  // within a string it would be written as \n
    }
  }
  return text + "\n}\n";
}

CommitRecord read_document(const nlohmann::json& document, FaultList& faults) {
  constexpr int kMostSamples = 65536;
  CommitRecord record;
  StrictObject object = StrictValue(document, faults).object();
  if (!object.has_format(kCommitRecordFormat, kCommitRecordVersion)) return record;
  record.shard = object.at("shard").text(kShardNameForm, is_shard_name);
  record.plan_hash = read_hash(object.at("plan_hash"));
  record.sha256 = read_hash(object.at("sha256"));
  record.size_bytes = object.at("size_bytes").integer<std::int64_t>(0, INT64_MAX);
  record.samples = object.at("samples").integer(0, kMostSamples);
  const StrictValue valid = object.at("valid");
  record.valid = valid.integer(0, record.samples);
  record.quarantined = read_quarantined(object.at("quarantined"), record.samples);
  record.contents.boxes = read_row_counts(object.at("boxes"), record.samples, faults);
  record.contents.persons = read_row_counts(object.at("persons"), record.samples, faults);
  for (const auto& [name, boxes] : object.at("classes").members()) {
    record.contents.classes[name] = boxes.integer<std::int64_t>(1, INT64_MAX);
  }
  record.contents.gaps = read_gaps(object.at("gaps"), record.samples);
  for (const StrictValue& column : object.at("optional_columns").elements()) {
    record.contents.optional_columns.push_back(column.text());
  }
  for (const auto& [stage, seconds] : object.at("stage_seconds").members()) {
    record.stage_seconds[stage] = seconds.number(0, kMostSeconds);
  }
  record.wall_seconds = object.at("wall_seconds").number(0, kMostSeconds);
  if (const auto outlines = object.find("outlines")) {
    StrictObject counts = outlines->object();
    const auto count = [&](const char* key) {
      return counts.at(key).integer<std::int64_t>(0, INT64_MAX);
    };
    record.inputs.outlines = {count("given"), count("cut"), count("ellipses")};
    counts.finish();
  }
  if (const auto found = object.find("label_losses")) {
    StrictObject losses = found->object();
    record.inputs.losses = {read_reasons(losses.at("boxes")), read_reasons(losses.at("outlines")),
                            read_reasons(losses.at("tracks")),
                            losses.at("of_other_classes").integer<std::int64_t>(0, INT64_MAX)};
    losses.finish();
  }
  if (const auto pairs = object.find("same_images")) {
    record.inputs.same_images = pairs->integer(0, record.samples);
  }
  if (const auto volumes = object.find("empty_volumes")) {
    record.inputs.empty_volumes = volumes->integer(0, record.samples);
  }
  if (const auto peak = object.find("peak_bytes")) {
    record.peak_bytes = peak->integer<std::int64_t>(0, INT64_MAX);
  }
  object.finish();
  record.unknown = faults.unknown_keys();
  // A slot is either good or accounted for. Only worth saying if the numbers themselves are sound.
  const auto lost = static_cast<int>(record.quarantined.size());
  if (faults.empty() && record.valid + lost != record.samples) {
    valid.fault(std::to_string(record.samples - lost) + " (samples minus quarantined ones)");
  }
  return record;
}

}  // namespace

std::string to_json(const CommitRecord& record) {
  nlohmann::json quarantined = nlohmann::json::array();
  for (const QuarantinedSample& sample : record.quarantined) {
    quarantined.push_back(
        {{"slot", sample.slot}, {"sample_id", sample.sample_id}, {"reason", sample.reason}});
  }
  nlohmann::json gaps = nlohmann::json::array();
  for (const auto& [gap, samples] : record.contents.gaps) {
    gaps.push_back({{"gap", gap}, {"samples", samples}});
  }
  for (const auto& [stage, seconds] : record.stage_seconds) {
    require_seconds(seconds, "stage " + stage);
  }
  require_seconds(record.wall_seconds, "wall_seconds");
  nlohmann::json json = {{"format", kCommitRecordFormat},
                         {"version", to_string(kCommitRecordVersion)},
                         {"shard", record.shard},
                         {"plan_hash", record.plan_hash},
                         {"sha256", record.sha256},
                         {"size_bytes", record.size_bytes},
                         {"samples", record.samples},
                         {"valid", record.valid},
                         {"quarantined", quarantined},
                         {"boxes", record.contents.boxes},
                         {"persons", record.contents.persons},
                         {"classes", record.contents.classes},
                         {"gaps", gaps},
                         {"optional_columns", record.contents.optional_columns},
                         {"stage_seconds", record.stage_seconds},
                         {"wall_seconds", record.wall_seconds},
                         {"peak_bytes", record.peak_bytes}};
  const auto& [losses, same_images, empty_volumes, outlines] = record.inputs;
  if (outlines != OutlineCounts()) {
    json["outlines"] = {
        {"given", outlines.given}, {"cut", outlines.cut}, {"ellipses", outlines.ellipses}};
  }
  if (losses != LabelLosses()) {
    json["label_losses"] = {{"boxes", json_of(losses.boxes)},
                            {"outlines", json_of(losses.outlines)},
                            {"tracks", json_of(losses.tracks)},
                            {"of_other_classes", losses.of_other_classes}};
  }
  if (same_images > 0) json["same_images"] = same_images;
  if (empty_volumes > 0) json["empty_volumes"] = empty_volumes;
  return indented(json);
}

CommitRecord parse_commit_record(std::string_view text, const std::string& name) {
  CommitRecord record;
  FaultList faults(name);
  if (const auto document = parse_json_text(text, faults))
    record = read_document(*document, faults);
  if (!faults.empty()) throw std::runtime_error(faults.text());
  return record;
}

bool is_shard_name(std::string_view name) {
  if (!take_end(name, ".h5") || !take_number(name) || !take_end(name, "-of-") ||
      !take_number(name) || !take_end(name, "-")) {
    return false;
  }
  // The job's name and the split's; both may have hyphens.
  for (std::size_t hyphen = name.find('-'); hyphen != name.npos;
       hyphen = name.find('-', hyphen + 1)) {
    if (is_name(name.substr(0, hyphen)) && is_name(name.substr(hyphen + 1))) return true;
  }
  return false;
}

std::string commit_record_name(const std::string& shard_name) {
  // Of a shard that somebody has renamed too.
  if (shard_name.size() <= 3 || !shard_name.ends_with(".h5") ||
      shard_name.find('/') != shard_name.npos) {
    throw std::invalid_argument("expected a shard name ending in .h5, got \"" + shard_name + "\"");
  }
  return shard_name.substr(0, shard_name.size() - 3) + ".json";
}

}  // namespace eventgan
