#include "pipeline/simulation/recording_plan.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>

#include "manifests/documents/json_text.h"
#include "manifests/documents/manifest_fields.h"
#include "manifests/documents/plan.h"
#include "manifests/values/faults.h"
#include "manifests/values/words.h"
#include "pipeline/planning/fingerprint.h"

namespace eventgan {
namespace {

nlohmann::json source_json(const SimulationSource& source) {
  nlohmann::json json = {{"path", source.path}, {"method", to_string(source.method)}};
  if (source.method.motion == SimulationMethod::kStills) return json;  // each is what it is of
  json["first_frame"] = source.first_frame;
  json["frame_step"] = source.frame_step;
  if (source.frames_per_second) json["frames_per_second"] = *source.frames_per_second;
  if (source.method.moves_one_frame()) {
    json["frames_per_image"] = source.frames_per_image;
    json["max_displacement_px"] = source.max_displacement_px;
  } else {
    json["frame_count"] = source.frame_count;
  }
  return json;
}

}  // namespace

std::string recording_settings(const SimulationManifest& manifest, const SimulationSource& source,
                               const std::string& recording, const std::string& files_hash,
                               std::optional<std::int64_t> image, const std::string& still) {
  nlohmann::json json = {{"program", program_version()},
                         {"libraries", "OpenCV " + cv::getVersionString()},
                         {"seed", manifest.seed},
                         {"name", recording},
                         {"source", source_json(source)},
                         {"files", files_hash},
                         {"sensor", nlohmann::json::parse(to_json(manifest.sensor))}};
  if (image) json["image"] = *image;
  if (!still.empty()) json["still"] = still;
  if (manifest.size) {
    json["size"] = {{"width", manifest.size->width}, {"height", manifest.size->height}};
  }
  return dump_json(json);
}

void check_same_clip(const std::filesystem::path& file, const std::string& found,
                     const std::string& expected) {
  const auto clip = [](const std::string& settings) {
    auto fields = manifest_fields(settings);
    std::erase_if(fields, [](const auto& field) { return field.first != "$.source.path"; });
    return fields;
  };
  const auto differences = fingerprint_differences(clip(found), clip(expected));
  if (differences.empty()) return;
  throw UsageError(
      "expected a recording of this clip, got one of another, in " + file.string() +
      " (choose another output folder, or remove it yourself): " + differences.front());
}

void check_same_settings(const std::filesystem::path& file, const std::string& found,
                         const std::string& expected) {
  if (found == expected) return;
  check_same_clip(file, found, expected);
  std::string message =
      file.string() +
      " was made by a run that would write different events (--overwrite makes it again):";
  for (const std::string& difference :
       fingerprint_differences(manifest_fields(found), manifest_fields(expected))) {
    message += "\n  " + difference;
  }
  throw UsageError(message);
}

namespace {

std::string file_name(const std::string& name, const SimulationManifest& manifest) {
  return fmt::format("{}.{}", name, to_string(manifest.file));
}

std::string numbered(const std::string& name, std::int64_t number) {
  constexpr std::size_t kDigits = 3;
  const std::string digits = std::to_string(number);
  const std::size_t zeros = digits.size() < kDigits ? kDigits - digits.size() : 0;
  return name + "-" + std::string(zeros, '0') + digits;
}

}  // namespace

std::vector<PlannedRecording> plan_recordings(const SimulationManifest& manifest,
                                              const SimulationSource& source,
                                              const ClipFrames& clip,
                                              const std::filesystem::path& folder) {
  std::vector<PlannedRecording> recordings;
  const auto add = [&](const std::string& name, std::optional<std::int64_t> position,
                       std::int64_t frame_count) {
    std::optional<std::int64_t> number;
    if (position) number = clip.number(*position);
    recordings.push_back({name, folder / file_name(name, manifest),
                          recording_settings(manifest, source, name, clip.files_hash(), number),
                          position, frame_count});
  };
  if (!source.method.moves_one_frame()) {
    add(source.name, std::nullopt, clip.count());
  } else {
    for (std::int64_t i = 0; i < clip.count(); ++i) {
      add(numbered(source.name, i), i, source.frames_per_image);
    }
  }
  return recordings;
}

std::vector<PlannedRecording> plan_recordings(const SimulationManifest& manifest,
                                              const SimulationSource& source,
                                              const StillScenes& scenes,
                                              const std::filesystem::path& folder,
                                              std::vector<std::string>& faults) {
  std::vector<PlannedRecording> recordings;
  for (std::int64_t i = 0; i < scenes.count(); ++i) try {
      const std::string name = numbered(source.name, i);
      recordings.push_back({name, folder / file_name(name, manifest),
                            recording_settings(manifest, source, name, scenes.hash(i), std::nullopt,
                                               scenes.still(i)),
                            i, scenes.frame_count(i)});
    } catch (const InputError& error) {
      faults.push_back(fmt::format("{} ({})", error.what(), scenes.still(i)));
    }
  return recordings;
}

}  // namespace eventgan
