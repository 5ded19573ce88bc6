#pragma once

#include <map>
#include <string>
#include <string_view>

#include "manifests/values/events.h"

namespace eventgan {

/// The settings of a manifest that change what a job writes, by JSON path: {"$.volume.bins", "9"},
/// values as JSON. Left out are comments, `errors` and `output.directory`: a user may change these
/// and go on with what is written. Throws std::runtime_error if the text is no JSON.
std::map<std::string, std::string> manifest_fields(std::string_view text);

/// All of a sensor as compact JSON, keys as in the manifests: what reports and recordings say of a
/// sensor.
std::string to_json(const SensorSpec& spec);

}  // namespace eventgan
