#include "pipeline/simulation/recording_plan.h"

#include "pipeline/simulation/recording_settings.h"

namespace eventgan {
namespace {

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
    recordings.push_back({name, folder / (name + ".hdf5"),
                          recording_settings(manifest, source, name, clip.files_hash(), number),
                          position, frame_count});
  };
  if (source.method != SimulationMethod::kAffine) {
    add(source.name, std::nullopt, clip.count());
  } else {
    for (std::int64_t i = 0; i < clip.count(); ++i) {
      add(numbered(source.name, i), i, source.frames_per_picture);
    }
  }
  return recordings;
}

}  // namespace eventgan
