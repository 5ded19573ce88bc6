#include "pipeline/calibration/calibrated_file.h"

#include <nlohmann/json.hpp>

#include "manifests/faults.h"
#include "manifests/strict_json/json_text_internal.h"
#include "manifests/weights_name.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kExtension[] = ".safetensors";
constexpr char kMark[] = "-calibrated";

fs::path given(const std::string& out) {
  if (!out.ends_with(kExtension)) {
    throw UsageError("--out: expected a file named *.safetensors, got \"" + out + "\"");
  }
  const fs::path file = fs::absolute(out);
  if (!fs::is_directory(file.parent_path())) {
    throw UsageError("--out: expected a file in a folder that is there, got \"" + out + "\"");
  }
  return file;
}

}  // namespace

fs::path calibrated_file(const JobManifest& manifest, int base_channels,
                         const std::optional<std::string>& out) {
  if (out) return given(*out);
  const std::string width = std::to_string(base_channels);
  const WeightsName name = parse_weights_name(manifest.generator.weights).value();
  if (name.origin != WeightsOrigin::kFile) {
    const bool is_shipped = name.origin == WeightsOrigin::kShipped;
    return manifest.directory /
           ((is_shipped ? "eventgan-" : "untrained-") + width + kMark + kExtension);
  }
  const std::string stem = fs::path(name.path).stem().string();
  const bool is_marked = stem.ends_with(kMark);
  const fs::path file = manifest.directory / (stem + (is_marked ? "" : kMark) + kExtension);
  std::error_code absent;
  if (fs::equivalent(file, resolve(manifest, name.path), absent)) {
    throw UsageError("--out: expected a file for the new calibration, got none, and the default, " +
                     file.string() + ", is the file that is calibrated");
  }
  return file;
}

std::string calibrated_generator_line(const JobManifest& manifest, const fs::path& file) {
  fs::path shown = file.lexically_relative(manifest.directory);
  if (shown.empty() || *shown.begin() == "..") shown = file;
  return "\"generator\": { \"weights\": " + dump_json(nlohmann::json(shown.generic_string())) +
         ", \"precision\": \"int8\" }";
}

}  // namespace eventgan
