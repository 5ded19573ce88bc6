#include "manifests/documents/simulation_manifest.h"

#include <set>

#include "manifests/documents/detail/job_manifest.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/values/words.h"

namespace eventgan {
namespace {

constexpr std::string_view kSimulationFormat = "eventgan-simulation";
constexpr int kSimulationVersion = 1;
constexpr std::int64_t kMostClipFrames = 1'000'000'000;
constexpr int kSmallestSensorSide = 16;
constexpr int kLargestSensorSide = 8192;

/// The name, or else the path's stem where that can be part of a file name.
std::string read_recording_name(StrictObject& source, const std::string& path) {
  if (const auto name = source.find("name")) return read_name(*name);
  const std::string stem = std::filesystem::path(path).stem().string();
  if (!path.empty() && !is_name(stem)) return read_name(source.at("name"));
  return stem;
}

void read_affine(StrictObject& source, std::optional<SimulationMethod> method,
                 SimulationSource& spec) {
  const auto find = [&](std::string_view key) {
    auto value = source.find(key);
    if (value && method && *method != SimulationMethod::kAffine) {
      value->fault("no such key for method \"" + std::string(to_string(*method)) +
                   "\" (only for affine)");
      value.reset();
    }
    return value;
  };
  if (const auto frames = find("frames_per_image")) {
    spec.frames_per_image = frames->integer(2, 100);
  }
  if (const auto displacement = find("max_displacement_px")) {
    spec.max_displacement_px = displacement->number(0.1, 100);
  }
}

SimulationSource read_simulation_source(const StrictValue& value) {
  SimulationSource spec;
  StrictObject object = value.object();
  spec.path = read_path(object.at("path"));
  spec.name = read_recording_name(object, spec.path);
  std::optional<SimulationMethod> method = spec.method;
  if (const auto found = object.find("method")) {
    method = found->sound_choice(kSimulationMethodWords);
  }
  spec.method = method.value_or(spec.method);
  if (const auto rate = object.find("frames_per_second")) {
    spec.frames_per_second = rate->number(1e-6, 1e6);
  }
  if (const auto first = object.find("first_frame")) {
    spec.first_frame = first->integer<std::int64_t>(0, kMostClipFrames);
  }
  if (const auto count = object.find("frame_count")) {
    spec.frame_count = count->integer<std::int64_t>(0, kMostClipFrames);
    if (spec.frame_count == 1 && method && *method != SimulationMethod::kAffine) {
      count->fault("0 (to the end) or at least 2 frames, since events lie between frames");
    }
  }
  if (const auto step = object.find("frame_step")) {
    spec.frame_step = step->integer<std::int64_t>(1, 100);
  }
  read_affine(object, method, spec);
  object.finish();
  return spec;
}

/// "a" for "a-000": the affine source that could have a recording of this name.
std::string_view possible_affine_name(std::string_view name) {
  const std::size_t dash = name.find_last_not_of("0123456789");
  const bool numbered = dash != std::string_view::npos && name[dash] == '-';
  return numbered ? name.substr(0, dash) : std::string_view();
}

/// No two recordings may have one name.
void check_names(const std::vector<StrictValue>& elements,
                 const std::vector<SimulationSource>& sources) {
  std::set<std::string_view> names, affine_names;
  for (const SimulationSource& source : sources) {
    if (source.method == SimulationMethod::kAffine) affine_names.insert(source.name);
  }
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string& name = sources[i].name;
    if (name.empty()) continue;  // faulty, as is reported already
    if (!names.insert(name).second) {
      elements[i].fault("a name that no other source has", "\"" + name + "\" again");
    } else if (!affine_names.contains(name) && affine_names.contains(possible_affine_name(name))) {
      elements[i].fault("a name that no recording of an affine source has", "\"" + name + "\"");
    }
  }
}

std::vector<SimulationSource> read_simulation_sources(const StrictValue& value) {
  const std::vector<StrictValue> elements = value.elements(1);
  std::vector<SimulationSource> sources;
  for (const StrictValue& element : elements) sources.push_back(read_simulation_source(element));
  check_names(elements, sources);
  return sources;
}

SimulationManifest read_simulation_document(const StrictValue& document) {
  SimulationManifest manifest;
  StrictObject object = document.object();
  if (!object.has_format(kSimulationFormat, kSimulationVersion)) return manifest;
  manifest.name = read_name(object.at("name"));
  if (const auto seed = object.find("seed")) manifest.seed = read_seed(*seed);
  manifest.sources = read_simulation_sources(object.at("sources"));
  if (const auto size = object.find("size"))
    manifest.size = read_size(*size, kSmallestSensorSide, kLargestSensorSide);
  if (const auto sensor = object.find("sensor")) manifest.sensor = read_sensor(*sensor);
  StrictObject output = object.at("output").object();
  manifest.output_directory = read_path(output.at("directory"));
  output.finish();
  object.finish();
  return manifest;
}

}  // namespace

SimulationManifest parse_simulation_manifest(std::string_view text,
                                             const std::filesystem::path& directory,
                                             const std::string& name) {
  return parse_manifest<SimulationManifest>(text, directory, name, read_simulation_document);
}

SimulationManifest read_simulation_manifest(const std::filesystem::path& file) {
  return parse_simulation_manifest(read_manifest_text(file), manifest_folder(file), file.string());
}

}  // namespace eventgan
