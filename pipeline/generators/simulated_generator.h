#pragma once

#include <memory>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/generators.h"
#include "manifests/values/job.h"
#include "stages/events/simulation/interval.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// Two frames and what their events depend on beside them.
struct SimulatorInput {
  const GreyImage& previous;
  const GreyImage& next;
  double duration_s;
  double max_displacement_px;  ///< of a model that moves_one_frame
  SensorSpec sensor;           ///< the pair's
  CounterRandom random;
  const FramesBetween* between = nullptr;  ///< null: not known
};

/// A model of kGenerators that has_sensor_settings: what `convert`, `realism` and `simulate` have
/// it do.
struct Simulator {
  GeneratorKind kind;
  /// Pixel by pixel, as pixel_events. Thread safe.
  std::vector<Event> (*events)(const SimulatorInput&);
  /// What a sensor sees from one frame of a clip to the next; null if it moves_one_frame.
  std::unique_ptr<Interval> (*between)(GreyImage previous, GreyImage next) = nullptr;
};

/// Throws std::invalid_argument for another kind.
const Simulator& simulator(GeneratorKind kind);

/// A model of the sensor in the network's place (stages/events/simulation), to compare with it: a
/// kind that has_sensor_settings. Its volumes are event_volume() of the simulated events: counts,
/// not normalised. Frames are rounded to 8-bit grey again, which they were before they were
/// prepared.
///
/// A pair's threshold, if it has one, is that of both polarities, with spec.threshold's spread.
/// Random numbers come from the seed and the content of the two frames, so a volume depends on
/// these alone. description() names the model and every parameter. Throws std::invalid_argument for
/// another kind.
std::unique_ptr<Generator> make_simulated_generator(const GeneratorSpec& spec, int bins,
                                                    std::uint64_t seed);

}  // namespace eventgan
