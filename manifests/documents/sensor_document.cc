#include "manifests/documents/sensor_document.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "manifests/documents/detail/job_manifest.h"
#include "manifests/documents/detail/json_text.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/documents/detail/sensor_document.h"
#include "manifests/values/faults.h"

namespace eventgan {
namespace {

constexpr std::string_view kSensorFormat = "eventgan-sensor";
constexpr int kSensorVersion = 1;

/// The text of a document, and what messages call it; none if the name is neither.
struct SensorText {
  std::string text;
  std::string name;
};
std::optional<SensorText> find_document(const std::string& path_or_name,
                                        const std::filesystem::path& directory) {
  if (path_or_name.ends_with(".json")) {
    const std::filesystem::path file = directory / path_or_name;
    return SensorText{read_manifest_text(file, "a sensor's document"), file.string()};
  }
  const auto shipped = shipped_sensor_documents().find(path_or_name);
  if (shipped == shipped_sensor_documents().end()) return std::nullopt;
  return SensorText{std::string(shipped->second), "the shipped sensor " + path_or_name};
}

}  // namespace

CameraSensor read_camera_sensor(const StrictValue& value) {
  CameraSensor sensor;
  StrictObject object = value.object();
  if (!object.has_format(kSensorFormat, kSensorVersion)) return sensor;
  sensor.name = read_name(object.at("name"));
  const auto ratio = object.find("threshold_ratio");
  if (const auto threshold = object.find("threshold")) {
    sensor.threshold = read_threshold(*threshold, ratio);
  } else if (ratio) {
    ratio->fault("threshold beside it", "none");
  }
  if (const auto noise = object.find("noise")) sensor.noise = read_noise(*noise);
  if (const auto origin = object.find("origin")) sensor.origin = origin->text();
  object.finish();
  return sensor;
}

CameraSensor parse_camera_sensor(std::string_view text, const std::string& name) {
  CameraSensor sensor;
  FaultList faults(name);
  if (const auto document = parse_json_text(text, faults)) {
    sensor = read_camera_sensor(StrictValue(*document, faults));
  }
  if (!faults.empty()) throw UsageError(faults.text());
  return sensor;
}

CameraSensor open_camera_sensor(const std::string& path_or_name) {
  if (const auto found = find_document(path_or_name, {})) {
    return parse_camera_sensor(found->text, found->name);
  }
  throw UsageError(fmt::format("expected {} or the path of a sensor's document (*.json), got {}",
                               fmt::join(shipped_sensors(), ", "), path_or_name));
}

std::vector<std::string> shipped_sensors() {
  std::vector<std::string> names;
  for (const auto& [name, text] : shipped_sensor_documents()) names.push_back(name);
  return names;
}

std::string with_sensor_document(std::string_view text, const std::filesystem::path& directory) {
  const nlohmann::json::json_pointer place("/generator/sensor");
  FaultList faults("");
  auto manifest = parse_json_text(text, faults);
  if (!faults.empty() || !manifest->contains(place) || !manifest->at(place).is_string()) {
    return std::string(text);
  }
  const auto found = find_document(manifest->at(place), directory);
  if (!found) return std::string(text);
  parse_camera_sensor(found->text, found->name);  // its faults are told as the document's own
  manifest->at(place) = parse_json_text(found->text, faults).value();
  return dump_json(*manifest, JsonLayout::kIndented) + "\n";
}

namespace {

nlohmann::ordered_json range_json(const std::array<double, 2>& range) {
  if (range[0] == range[1]) return range[0];
  return range;
}

}  // namespace

std::string to_document(const CameraSensor& sensor) {
  nlohmann::ordered_json json = {
      {"format", kSensorFormat}, {"version", kSensorVersion}, {"name", sensor.name}};
  if (sensor.threshold) {
    json["threshold"] = range_json(sensor.threshold->range);
    json["threshold_ratio"] = sensor.threshold->ratio;
  }
  if (const auto& noise = sensor.noise) {
    json["noise"] = {{"shot_hz", range_json(noise->shot_hz)},
                     {"leak_hz", range_json(noise->leak_hz)},
                     {"hot_pixels", range_json(noise->hot_pixels)}};
  }
  if (!sensor.origin.empty()) json["origin"] = sensor.origin;
  return dump_json(json, JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan
