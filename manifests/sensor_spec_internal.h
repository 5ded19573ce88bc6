#pragma once

#include "manifests/sensor_spec.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// Reads a manifest's `sensor`, whose keys are SensorSpec's.
SensorSpec read_sensor(const StrictValue& value);

}  // namespace eventgan
