#include "manifests/documents/marker.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/documents/json_text_internal.h"
#include "manifests/documents/manifest_file_internal.h"
#include "manifests/documents/strict_json_internal.h"

namespace eventgan {
namespace {

constexpr char kMarkerFormat[] = "eventgan-marker";
constexpr int kMarkerVersion = 2;
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

void require_seconds(double seconds, const std::string& of) {
  if (seconds >= 0 && seconds <= kMostSeconds) return;  // false for NaN
  throw std::invalid_argument("expected seconds of 0 or more, got " + std::to_string(seconds) +
                              ", for " + of);
}

/// Canonical JSON of a marker: two-space indent, except that an array of numbers stands on one
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

ShardMarker read_document(const nlohmann::json& document, FaultList& faults) {
  constexpr int kMostSamples = 65536;
  ShardMarker marker;
  StrictObject object = StrictValue(document, faults).object();
  if (!object.has_format(kMarkerFormat, kMarkerVersion)) return marker;
  marker.shard = object.at("shard").text(kShardNameForm, is_shard_name);
  marker.plan_hash = read_hash(object.at("plan_hash"));
  marker.sha256 = read_hash(object.at("sha256"));
  marker.size_bytes = object.at("size_bytes").integer<std::int64_t>(0, INT64_MAX);
  marker.samples = object.at("samples").integer(0, kMostSamples);
  const StrictValue valid = object.at("valid");
  marker.valid = valid.integer(0, marker.samples);
  marker.quarantined = read_quarantined(object.at("quarantined"), marker.samples);
  marker.contents.boxes = read_row_counts(object.at("boxes"), marker.samples, faults);
  marker.contents.persons = read_row_counts(object.at("persons"), marker.samples, faults);
  for (const auto& [name, boxes] : object.at("classes").members()) {
    marker.contents.classes[name] = boxes.integer<std::int64_t>(1, INT64_MAX);
  }
  marker.contents.gaps = read_gaps(object.at("gaps"), marker.samples);
  for (const StrictValue& column : object.at("optional_columns").elements()) {
    marker.contents.optional_columns.push_back(column.text());
  }
  for (const auto& [stage, seconds] : object.at("stage_seconds").members()) {
    marker.stage_seconds[stage] = seconds.number(0, kMostSeconds);
  }
  marker.wall_seconds = object.at("wall_seconds").number(0, kMostSeconds);
  if (const auto peak = object.find("peak_bytes")) {
    marker.peak_bytes = peak->integer<std::int64_t>(0, INT64_MAX);
  }
  object.finish();
  // A slot is either good or accounted for. Only worth saying if the numbers themselves are sound.
  const auto lost = static_cast<int>(marker.quarantined.size());
  if (faults.empty() && marker.valid + lost != marker.samples) {
    valid.fault(std::to_string(marker.samples - lost) + " (samples minus quarantined ones)");
  }
  return marker;
}

}  // namespace

std::string to_json(const ShardMarker& marker) {
  nlohmann::json quarantined = nlohmann::json::array();
  for (const QuarantinedSample& sample : marker.quarantined) {
    quarantined.push_back(
        {{"slot", sample.slot}, {"sample_id", sample.sample_id}, {"reason", sample.reason}});
  }
  nlohmann::json gaps = nlohmann::json::array();
  for (const auto& [gap, samples] : marker.contents.gaps) {
    gaps.push_back({{"gap", gap}, {"samples", samples}});
  }
  for (const auto& [stage, seconds] : marker.stage_seconds) {
    require_seconds(seconds, "stage " + stage);
  }
  require_seconds(marker.wall_seconds, "wall_seconds");
  return indented({{"format", kMarkerFormat},
                   {"version", kMarkerVersion},
                   {"shard", marker.shard},
                   {"plan_hash", marker.plan_hash},
                   {"sha256", marker.sha256},
                   {"size_bytes", marker.size_bytes},
                   {"samples", marker.samples},
                   {"valid", marker.valid},
                   {"quarantined", quarantined},
                   {"boxes", marker.contents.boxes},
                   {"persons", marker.contents.persons},
                   {"classes", marker.contents.classes},
                   {"gaps", gaps},
                   {"optional_columns", marker.contents.optional_columns},
                   {"stage_seconds", marker.stage_seconds},
                   {"wall_seconds", marker.wall_seconds},
                   {"peak_bytes", marker.peak_bytes}});
}

ShardMarker parse_marker(std::string_view text, const std::string& name) {
  ShardMarker marker;
  FaultList faults(name);
  if (const auto document = parse_json_text(text, faults))
    marker = read_document(*document, faults);
  if (!faults.empty()) throw std::runtime_error(faults.text());
  return marker;
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

std::string marker_name(const std::string& shard_name) {
  // Of a shard that somebody has renamed too.
  if (shard_name.size() <= 3 || !shard_name.ends_with(".h5") ||
      shard_name.find('/') != shard_name.npos) {
    throw std::invalid_argument("expected a shard name ending in .h5, got \"" + shard_name + "\"");
  }
  return shard_name.substr(0, shard_name.size() - 3) + ".json";
}

}  // namespace eventgan
