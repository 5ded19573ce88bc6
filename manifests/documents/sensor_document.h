#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/events.h"

namespace eventgan {

/// Names of the sensors that are part of the program, sorted.
std::vector<std::string> shipped_sensors();

/// The sensor of a document, manifests/schemas/sensor.schema.json: of a path (*.json) or a shipped
/// name. Throws UsageError listing every fault, or the names there are; InputError if the file
/// cannot be read.
CameraSensor open_camera_sensor(const std::string& path_or_name);

/// The same from text; `name` stands for the file in messages.
CameraSensor parse_camera_sensor(std::string_view text, const std::string& name);

/// The sensor as a document, with a line's end behind it.
std::string to_document(const CameraSensor& sensor);

}  // namespace eventgan
