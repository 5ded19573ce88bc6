#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "manifests/training_manifest.h"
#include "stages/recordings/recording.h"

namespace eventgan {

/// A recording that is open, with the part of it that pairs are drawn from.
struct TrainingRecording {
  std::filesystem::path file;  ///< absolute
  std::shared_ptr<const Recording> recording;
  double weight = 1;             ///< relative chance of a sample to come from here
  std::int64_t first_frame = 0;  ///< of the part in use
  std::int64_t last_frame = 0;   ///< of the part in use, itself included; > first_frame
};

/// Opens the recordings of a manifest; relative paths start at `directory`. Throws InputError if
/// one cannot be opened, and UsageError listing every one that is of no use: smaller than
/// `smallest`, or with a part in use that is not there or has no pair `smallest_gap` frames apart.
std::vector<TrainingRecording> open_training_recordings(std::span<const RecordingSpec> specs,
                                                        const std::filesystem::path& directory,
                                                        ImageSize smallest, int smallest_gap);

}  // namespace eventgan
