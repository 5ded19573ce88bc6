#pragma once

#include <memory>

#include "manifests/values/job.h"
#include "stages/generator/generator.h"

namespace eventgan {

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
