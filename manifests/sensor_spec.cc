#include <nlohmann/json.hpp>

#include "manifests/sensor_spec_internal.h"

namespace eventgan {
namespace {

constexpr double kLargestRate_hz = 1e6;

}  // namespace

SensorSpec read_sensor(const StrictValue& value) {
  SensorSpec spec;
  StrictObject object = value.object();
  const auto read = [&](const char* key, double& number, double lowest, double highest) {
    if (const auto found = object.find(key)) number = found->number(lowest, highest);
  };
  read("positive_threshold", spec.positive_threshold, 0.01, 5);
  read("negative_threshold", spec.negative_threshold, 0.01, 5);
  read("threshold_spread", spec.threshold_spread, 0, 1);
  read("refractory_s", spec.refractory_s, 0, 1);
  read("leak_rate_hz", spec.leak_rate_hz, 0, kLargestRate_hz);
  read("shot_noise_rate_hz", spec.shot_noise_rate_hz, 0, kLargestRate_hz);
  read("hot_pixel_fraction", spec.hot_pixel_fraction, 0, 1);
  read("hot_pixel_rate_hz", spec.hot_pixel_rate_hz, 0, kLargestRate_hz);
  read("log_epsilon", spec.log_epsilon, 1e-6, 1);
  object.finish();
  return spec;
}

std::string to_json(const SensorSpec& spec) {
  const nlohmann::json json = {{"positive_threshold", spec.positive_threshold},
                               {"negative_threshold", spec.negative_threshold},
                               {"threshold_spread", spec.threshold_spread},
                               {"refractory_s", spec.refractory_s},
                               {"leak_rate_hz", spec.leak_rate_hz},
                               {"shot_noise_rate_hz", spec.shot_noise_rate_hz},
                               {"hot_pixel_fraction", spec.hot_pixel_fraction},
                               {"hot_pixel_rate_hz", spec.hot_pixel_rate_hz},
                               {"log_epsilon", spec.log_epsilon}};
  return json.dump();
}

}  // namespace eventgan
