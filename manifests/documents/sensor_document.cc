#include "manifests/documents/sensor_document.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/documents/detail/sensor_document.h"
#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"

namespace eventgan {
namespace {

constexpr double kLeastContrast = 0.01, kMostContrast = 5;

/// The text of a document, and what messages call it; none if the name is neither.
struct SensorText {
  std::string text;
  std::string name;
};
std::optional<SensorText> find_document(const std::string& path_or_name,
                                        const std::filesystem::path& directory) {
  if (path_or_name.ends_with(".json")) {
    const std::filesystem::path file = directory / path_or_name;
    constexpr std::size_t kMostBytes = 1 << 16;  // every shard has it
    SensorText document{read_manifest_text(file, "a sensor's document"), file.string()};
    if (document.text.size() <= kMostBytes) return document;
    throw UsageError(fmt::format("expected a sensor's document of at most {} bytes, got {}, in {}",
                                 kMostBytes, document.text.size(), document.name));
  }
  const auto shipped = shipped_sensor_documents().find(path_or_name);
  if (shipped == shipped_sensor_documents().end()) return std::nullopt;
  return SensorText{std::string(shipped->second), "the shipped sensor " + path_or_name};
}

/// `some`: all fields, or those of some kinds.
template <class Some>
void list_settings(Some& some, SensorSpec& spec) {
  const Numbers thresholds = numbers(kLeastContrast, kMostContrast);
  const Numbers rates = numbers(0, 1e6);
  some.find("positive_threshold", spec.positive_threshold, thresholds,
            "Mean contrast threshold of positive events.");
  some.find("negative_threshold", spec.negative_threshold, thresholds,
            "The same of negative events, as a positive number.");
  some.find("threshold_spread", spec.threshold_spread, numbers(0, 1),
            "Standard deviation of the thresholds over the pixels, drawn per polarity.");
  some.find("refractory_s", spec.refractory_s, numbers(0, 1),
            "A pixel is silent so long after an event.");
  some.find("leak_rate_hz", spec.leak_rate_hz, rates,
            "Positive events per pixel and second without any motion.");
  some.find(
      "shot_noise_rate_hz", spec.shot_noise_rate_hz, rates,
      "Random events of either polarity per pixel and second where it is black; a quarter of it "
      "at white.");
  some.find("hot_pixel_fraction", spec.hot_pixel_fraction, numbers(0, 1),
            "Share of pixels that fire on their own.");
  some.find("hot_pixel_rate_hz", spec.hot_pixel_rate_hz, rates,
            "Events of a hot pixel per second.");
  some.find("log_epsilon", spec.log_epsilon, numbers(1e-6, 1),
            "Added to the intensity, so that the logarithm of black is finite.");
}

}  // namespace

void list_sensor(Fields& fields, SensorSpec& spec) { list_settings(fields, spec); }
void list_sensor(Fields::Only fields, SensorSpec& spec) { list_settings(fields, spec); }

void list_threshold(Fields& fields, std::optional<ThresholdSpec>& threshold,
                    std::string_view what) {
  std::optional<std::array<double, 2>> range;
  ThresholdSpec spec = threshold.value_or(ThresholdSpec());
  if (threshold) range = spec.range;
  fields.find("threshold", range, ranges(kLeastContrast, kMostContrast), what);
  if (range || !fields.is_writing()) {
    fields.find("threshold_ratio", spec.ratio,
                numbers(ThresholdSpec::kRatios[0], ThresholdSpec::kRatios[1]),
                "Of the negative threshold to the positive one; beside threshold only.");
    fields.needs("threshold_ratio", "threshold");
  }
  if (range) {
    spec.range = *range;
    threshold = spec;
  }
}

void list_noise(Fields& fields, NoiseSpec& spec) {
  fields.find("shot_hz", spec.shot_hz, ranges(0, kMostNoise_hz),
              "Events per pixel and second, half of them of either polarity.");
  fields.find("leak_hz", spec.leak_hz, ranges(0, kMostNoise_hz),
              "Positive events per pixel and second.");
  fields.find("hot_pixels", spec.hot_pixels, ranges(0, 1),
              "Share of the pixels that are hot: the same ones for all samples of a kind of "
              "dataset and a size, each of one polarity and of a rate of 5 to 100 Hz.");
}

namespace {

void list_network_threshold(Fields& fields, NetworkThreshold& network) {
  fields.at("weights", network.weights, texts(), "SHA-256 of the weights that it is of.");
  std::optional<ThresholdSpec> threshold;
  if (fields.is_writing()) threshold = network.threshold;
  list_threshold(fields, threshold, "Contrast threshold, or [least, most], as above.");
  if (threshold) {
    network.threshold = *threshold;
  } else if (fields.is_reading() && fields.is_sound("threshold")) {
    fields.fault("threshold", "a number or [least, most]");
  }
}

}  // namespace

void list_camera_sensor(Fields& fields, CameraSensor& sensor) {
  if (!fields.has_format("eventgan-sensor", 1)) return;
  fields.at("name", sensor.name, names(), "Name of the camera.");
  list_threshold(fields, sensor.threshold,
                 "Contrast threshold of the models difference and esim, of ln(u/255 + 0.02), u the "
                 "frames' grey level, or [least, most], from which it is drawn log-uniformly for "
                 "each pair: the geometric mean of both polarities'.");
  fields.find("network", sensor.network, objects(list_network_threshold),
              "The threshold with which weights that know their sensor make as many events.");
  fields.find("noise", sensor.noise, objects(list_noise), kNoiseField);
  fields.find("origin", sensor.origin, texts(), "How the numbers were found, for people.");
}

CameraSensor parse_camera_sensor(std::string_view text, const std::string& name) {
  CameraSensor sensor;
  FaultList faults(name);
  if (const auto document = parse_json_text(text, faults)) {
    objects(list_camera_sensor).read(StrictValue(*document, faults), sensor);
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

std::string to_document(const CameraSensor& sensor) {
  return dump_json(objects(list_camera_sensor).json(sensor), JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan
