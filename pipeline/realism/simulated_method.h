#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "manifests/counter_random.h"
#include "manifests/event.h"
#include "manifests/sensor_spec.h"
#include "pipeline/realism/volume_method.h"

namespace eventgan {

/// A model of a moving scene that a simulated sensor looks at.
struct SimulatedScene {
  std::string name;
  std::function<std::vector<Event>(const IntervalFrames&, const SensorSpec&, CounterRandom)> events;
  int draws = 1;
};

/// Log intensity on a line from frame to frame: "difference".
SimulatedScene difference_scene();

/// A random affine motion of the previous frame, by at most `displacement_px` a frame: "esim".
SimulatedScene esim_scene(double displacement_px, int draws);

/// The sensor of a threshold, the same for both polarities; its spread over the pixels is 15 % of
/// it, as in SensorSpec's defaults; no refractory time and no noise.
SensorSpec realism_sensor(double threshold, double log_epsilon);

/// A model with a sensor; `fitted` is told in the report. Volumes of `bins` bins; random numbers by
/// seed, name, interval and draw.
std::unique_ptr<VolumeMethod> make_simulated_method(SimulatedScene scene, const SensorSpec& sensor,
                                                    bool fitted, int bins, std::uint64_t seed);

/// The threshold in 0.01..5 with which the model makes as many events as the camera did, over all
/// of `frames` and the mean of the draws, within 0.5 % or as near as it gets: by bisection, since
/// a higher threshold makes fewer events. Runs in the
/// calling thread's TBB arena; the result does not depend on its threads.
double fitted_threshold(const SimulatedScene& scene, std::span<const IntervalFrames> frames,
                        double log_epsilon, std::uint64_t seed);

}  // namespace eventgan
