#include "manifests/documents/simulation_manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/values/words.h"

namespace eventgan {
namespace {

constexpr std::int64_t kMostClipFrames = 1'000'000'000;
constexpr int kSmallestSensorSide = 16;
constexpr int kLargestSensorSide = 8192;

void list_clip(Fields& fields, SimulationSource& source) {
  fields.at("path", source.path, paths(),
            "A video, or a folder of images, taken in the order of their names. With method stills "
            "the manifest of a job of convert.");
  // Without a name it is the path's stem, where that can be part of a file name.
  source.name = std::filesystem::path(source.path).stem().string();
  constexpr char kName[] =
      "Name of the recording, NAME.hdf5; with methods affine and stills NAME-000.hdf5 and so on, "
      "one for each image. Default: the path's last part without extension.";
  if (source.path.empty() || is_name(source.name)) {
    fields.find("name", source.name, names(), kName);
  } else {
    fields.at("name", source.name, names(), kName);
  }
  fields.kind("method", source.method, words(kSimulationMethodWords),
              "clip: things move between frames along the dense optical flow. affine: each image "
              "moves by one random affine motion. difference: each pixel's log intensity moves on "
              "a line from frame to frame. stills: the clips that convert makes of photographs "
              "(pairs from stills, with frames), each a recording with its labels beside it.");
  const auto kinds = [](auto&& holds) { return words_where(kSimulationMethodWords, holds); };
  fields
      .only_for(
          kinds([](const auto& row) { return row.value.motion != SimulationMethod::kStills; }))
      .find("frames_per_second", source.frames_per_second, numbers(1e-6, 1e6),
            "frame rate of the whole clip. Default: the video's own times; 30 for images.");
  fields.find("first_frame", source.first_frame, integers(0, kMostClipFrames),
              "The first frame that is used, counted from 0; with method stills the first still.");
  const auto count = fields.find(
      "frame_count", source.frame_count, integers(0, kMostClipFrames),
      "How many frames are used, with methods affine and stills how many images; 0 = to "
      "the end.");
  if (count && source.frame_count == 1 && fields.is_sound("method") &&
      !source.method.records_each()) {
    count->fault("0 (to the end) or at least 2 frames, since events lie between frames");
  }
  Fields::Schema rule = Fields::Schema::parse(R"({
      "if": {"required": ["method"], "properties": {"method": {"enum": []}}},
      "else": {"properties": {"frame_count": {"not": {"const": 1}}}}})");
  rule["if"]["properties"]["method"]["enum"] =
      kinds([](const auto& row) { return row.value.records_each(); });
  fields.rule(rule);
  fields.find("frame_step", source.frame_step, integers(1, 100),
              "Uses each n-th frame, with method stills each n-th still.");
  auto of_one_frame =
      fields.only_for(kinds([](const auto& row) { return row.value.moves_one_frame(); }));
  of_one_frame.find("frames_per_image", source.frames_per_image, integers(2, 100),
                    "frames of the motion of one image.");
  of_one_frame.find("max_displacement_px", source.max_displacement_px, numbers(0.1, 100),
                    "how far an image moves from one of its frames to the next is drawn uniformly "
                    "from 0 to this, for each image.");
}

/// "a" for "a-000": the source of numbered recordings that could have one of this name.
std::string_view possible_numbered_name(std::string_view name) {
  const std::size_t dash = name.find_last_not_of("0123456789");
  const bool numbered = dash != std::string_view::npos && name[dash] == '-';
  return numbered ? name.substr(0, dash) : std::string_view();
}

/// No two recordings may have one name.
void check_names(const std::vector<StrictValue>& elements,
                 const std::vector<SimulationSource>& sources) {
  std::set<std::string_view> names, numbered_names;
  for (const SimulationSource& source : sources) {
    if (source.method.records_each()) numbered_names.insert(source.name);
  }
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string& name = sources[i].name;
    if (name.empty()) continue;  // faulty, as is reported already
    if (!names.insert(name).second) {
      elements[i].fault("a name that no other source has", "\"" + name + "\" again");
    } else if (!numbered_names.contains(name) &&
               numbered_names.contains(possible_numbered_name(name))) {
      elements[i].fault("a name that no numbered recording of another source has",
                        "\"" + name + "\"");
    }
  }
}

constexpr int kLargestRawSide = 2048;  // the words of EVT 3.0 have 11 bits for a coordinate

void list_simulation_output(Fields& fields, SimulationManifest& manifest) {
  fields.at("directory", manifest.output_directory, paths(),
            "Folder of the recordings; made if it is absent.");
  fields.find("format", manifest.file, words(kSimulatedFileWords),
              "hdf5: events, frames and flow in MVSEC's layout. aedat4: events and frames as AEDAT "
              "4.0, for DV's viewer. raw: events as Prophesee's RAW files, EVT 3.0.");
}

}  // namespace

void list_simulation(Fields& fields, SimulationManifest& manifest) {
  if (!fields.has_format("eventgan-simulation", 1)) return;
  fields.at("name", manifest.name, names(), "Name of the job.");
  fields.find("seed", manifest.seed, seeds(), kSeedField);
  const auto sources =
      fields.at("sources", manifest.sources, lists(objects(list_clip), 1),
                "The clips, each a recording or, with methods affine and stills, several.");
  if (sources && sources->is_array()) check_names(sources->elements(), manifest.sources);
  const auto size =
      fields.find("size", manifest.size, sizes(kSmallestSensorSide, kLargestSensorSide),
                  "Size of the sensor in pixels: frames are scaled to cover it and cut around the "
                  "centre. Without it, the frames' own size.");
  fields.find("sensor", manifest.sensor, objects(list_sensor),
              "The simulated sensor: a pixel signals when the natural logarithm of its intensity "
              "u/255 has moved by a threshold since its last event.");
  fields.at("output", manifest, objects(list_simulation_output), "The files that are made.");
  if (size && fields.is_sound("size") && manifest.file == SimulatedFile::kRaw &&
      std::max(manifest.size->width, manifest.size->height) > kLargestRawSide) {
    size->fault(fmt::format("at most {} pixels a side for the format raw", kLargestRawSide),
                fmt::format("{}x{}", manifest.size->width, manifest.size->height));
  }
  fields.rule(R"({"if": {"properties": {"output": {"required": ["format"],
                                                   "properties": {"format": {"const": "raw"}}}}},
                  "then": {"properties": {"size": {"properties": {"width": {"maximum": 2048},
                                                                  "height": {"maximum": 2048}}}}}})");
}

SimulationManifest parse_simulation_manifest(std::string_view text,
                                             const std::filesystem::path& directory,
                                             const std::string& name) {
  return parse_manifest<SimulationManifest>(text, directory, name, list_simulation);
}

SimulationManifest read_simulation_manifest(const std::filesystem::path& file) {
  return parse_simulation_manifest(read_manifest_text(file), manifest_folder(file), file.string());
}

}  // namespace eventgan
