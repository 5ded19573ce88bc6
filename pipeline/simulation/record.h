#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "manifests/counter_random.h"
#include "manifests/sensor_spec.h"
#include "pipeline/simulation/scene.h"
#include "pipeline/simulation/simulation_report.h"

namespace eventgan {

/// Lets a sensor look at a scene to its end and writes frames, events and flows as a recording
/// (MvsecWriter), which appears under its name when it is whole. `on_frame` is called after each
/// frame. Throws what scene, sensor and writer throw. Thread safe for different scenes and files.
RecordingSummary record(Scene& scene, const SensorSpec& sensor, CounterRandom random,
                        const std::filesystem::path& file, const std::string& settings,
                        const std::function<void()>& on_frame);

}  // namespace eventgan
