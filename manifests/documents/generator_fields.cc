#include <fmt/format.h>

#include <cmath>

#include "manifests/documents/detail/job_manifest.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/documents/detail/sensor_document.h"
#include "manifests/documents/detail/strict_json.h"
#include "manifests/documents/sensor_document.h"
#include "manifests/values/job.h"
#include "manifests/values/weights.h"
#include "manifests/values/words.h"

namespace eventgan {

namespace {

constexpr double kLargestRate_hz = 1e6;
constexpr double kLeastThreshold = 0.01, kMostThreshold = 5;

/// Reads what the simulators share; find(key) is a key's value, or none.
template <class Find>
SensorSpec read_sensor_keys(const Find& find) {
  SensorSpec spec;
  const auto read = [&](const char* key, double& number, double lowest, double highest) {
    if (const std::optional<StrictValue> found = find(key)) number = found->number(lowest, highest);
  };
  read("positive_threshold", spec.positive_threshold, kLeastThreshold, kMostThreshold);
  read("negative_threshold", spec.negative_threshold, kLeastThreshold, kMostThreshold);
  read("threshold_spread", spec.threshold_spread, 0, 1);
  read("refractory_s", spec.refractory_s, 0, 1);
  read("leak_rate_hz", spec.leak_rate_hz, 0, kLargestRate_hz);
  read("shot_noise_rate_hz", spec.shot_noise_rate_hz, 0, kLargestRate_hz);
  read("hot_pixel_fraction", spec.hot_pixel_fraction, 0, 1);
  read("hot_pixel_rate_hz", spec.hot_pixel_rate_hz, 0, kLargestRate_hz);
  read("log_epsilon", spec.log_epsilon, 1e-6, 1);
  return spec;
}

}  // namespace

SensorSpec read_sensor(const StrictValue& value) {
  StrictObject object = value.object();
  const SensorSpec spec = read_sensor_keys([&](const char* key) { return object.find(key); });
  object.finish();
  return spec;
}

namespace {

/// Reads a number, or [least, most].
std::array<double, 2> read_range(const StrictValue& value, double lowest, double highest) {
  if (value.is_array()) return read_ends(value, lowest, highest);
  const double number = value.number(lowest, highest);
  return {number, number};
}

}  // namespace

ThresholdSpec read_threshold(const StrictValue& value, const std::optional<StrictValue>& ratio) {
  ThresholdSpec threshold{.range = read_range(value, kLeastThreshold, kMostThreshold)};
  const auto [least, most] = ThresholdSpec::kRatios;
  if (ratio) threshold.ratio = ratio->number(least, most);
  return threshold;
}

NoiseSpec read_noise(const StrictValue& value) {
  NoiseSpec spec;
  StrictObject object = value.object();
  const auto read = [&](const char* key, std::array<double, 2>& range, double highest) {
    if (const auto found = object.find(key)) range = read_range(*found, 0, highest);
  };
  read("shot_hz", spec.shot_hz, kMostNoise_hz);
  read("leak_hz", spec.leak_hz, kMostNoise_hz);
  read("hot_pixels", spec.hot_pixels, 1);
  object.finish();
  return spec;
}

namespace {

/// A threshold is that of frames, unless an ε is told beside it.
void set_threshold(const ThresholdSpec& threshold, GeneratorSpec& spec,
                   std::optional<double> log_epsilon = std::nullopt) {
  const auto [least, most] = threshold.range;
  spec.sensor.log_epsilon = log_epsilon.value_or(kFrameLogEpsilon);
  spec.sensor = threshold.applied(spec.sensor, {std::sqrt(least * most), threshold.ratio});
  spec.threshold = threshold;
}

/// Reads a document in place of a `sensor`.
void read_camera(const StrictValue& value, GeneratorSpec& spec) {
  const CameraSensor camera = read_camera_sensor(value);
  spec.camera = camera.name;
  spec.noise = camera.noise;
  if (camera.threshold) set_threshold(*camera.threshold, spec);
}

/// The kinds of generator for which `holds` does.
template <class Holds>
std::vector<GeneratorKind> kinds_where(const Holds& holds) {
  std::vector<GeneratorKind> kinds;
  for (const GeneratorRow& row : kGenerators) {
    if (holds(row)) kinds.push_back(row.value);
  }
  return kinds;
}

/// Reads a generator's `sensor`: what is asked of any, and of a simulator its settings.
void read_generator_sensor(const StrictValue& value, std::optional<GeneratorKind> kind,
                           GeneratorSpec& spec) {
  if (value.is_text()) {  // a document would be here in its place (with_sensor_document)
    value.fault(fmt::format("{} or the path of a sensor's document (*.json)",
                            fmt::join(shipped_sensors(), ", ")));
    return;
  }
  StrictObject object = value.object();
  if (object.find("format")) return read_camera(value, spec);
  if (const auto noise = object.find("noise")) spec.noise = read_noise(*noise);
  SpecialKeys keys(object, "kind", kind);
  const auto owners = kinds_where([](const GeneratorRow& row) { return row.has_sensor_settings; });
  spec.sensor = read_sensor_keys([&](const char* key) { return keys.find(key, owners); });
  const auto ratio = object.find("threshold_ratio");
  if (const auto found = object.find("threshold")) {
    ThresholdSpec threshold = read_threshold(*found, ratio);
    if (object.find("threshold_spread")) threshold.spread = spec.sensor.threshold_spread;
    for (const char* own : {"positive_threshold", "negative_threshold"}) {
      if (const auto key = object.find(own)) {
        key->fault("no such key together with threshold, which sets it");
      }
    }
    const bool told = object.find("log_epsilon").has_value();
    set_threshold(threshold, spec, told ? std::optional(spec.sensor.log_epsilon) : std::nullopt);
  } else if (ratio) {
    ratio->fault("threshold beside it", "none");
  }
  object.finish();
}

}  // namespace

GeneratorSpec read_generator(const StrictValue& value) {
  GeneratorSpec spec;
  StrictObject object = value.object();
  std::optional<GeneratorKind> kind = spec.kind;
  if (const auto found = object.find("kind")) kind = found->sound_choice(kGeneratorWords);
  spec.kind = kind.value_or(spec.kind);

  SpecialKeys keys(object, "kind", kind);
  const auto find = [&](std::string_view key) {
    return keys.find(key, kinds_where([key](const GeneratorRow& row) { return takes(row, key); }));
  };
  if (const auto weights = find("weights")) {
    spec.weights = weights->text(
        "the path of a .safetensors file, \"shipped\", \"shipped:sensor\", or \"shipped:WIDTH\" or "
        "\"untrained:WIDTH\" with WIDTH in 1..64",
        [](std::string_view text) { return parse_weights_name(text).has_value(); });
  }
  if (const auto engine = find("engine")) {
    spec.engine = engine->choice(kEngineWords);
  }
  if (const auto device = find("device")) {
    spec.device = device->choice(kDeviceWords);
  }
  if (const auto precision = find("precision")) {
    spec.precision = precision->choice(kPrecisionWords);
  }
  if (const auto sample = find("sample")) spec.sample = sample->boolean();
  if (const auto scope = find("scope")) {
    spec.scope.scope = scope->choice(kScopeWords);
  }
  if (const auto threshold = find("motion_threshold")) {
    spec.scope.motion_threshold = threshold->number(0, 255);
  }
  if (const auto margin = find("motion_margin_px")) {
    spec.scope.motion_margin_px = margin->integer(0, 64);
  }
  if (const auto margin = find("label_margin_px")) {
    spec.scope.label_margin_px = margin->integer(0, 1024);
  }
  if (const auto tile = find("tile_px")) spec.scope.tile_px = tile->integer(8, 128);
  if (const auto sensor = find("sensor")) {
    read_generator_sensor(*sensor, kind, spec);
  }
  if (const auto duration = find("duration_s")) {
    spec.duration_s = duration->number(1e-4, 10);
    if (kind && has_weights(*kind) && !spec.noise) {
      duration->fault(
          fmt::format("no such key for kind \"{}\" without sensor.noise", to_string(*kind)));
    }
  }
  if (const auto displacement = find("max_displacement_px")) {
    spec.max_displacement_px = displacement->number(0.1, 100);
  }
  object.finish();
  return spec;
}

}  // namespace eventgan
