#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace eventgan {

/// The documents that are part of the program, by name (shipped_sensors.cmake).
const std::map<std::string, std::string_view, std::less<>>& shipped_sensor_documents();

/// A manifest's text in which `generator.sensor`, if it is a shipped name or the path of a document
/// (*.json, from `directory` on), has become that document: what the manifest says then stays with
/// the plan and the shards, whatever becomes of the file. Other texts as they are, faulty ones too.
/// Throws as open_camera_sensor.
std::string with_sensor_document(std::string_view text, const std::filesystem::path& directory);

}  // namespace eventgan
