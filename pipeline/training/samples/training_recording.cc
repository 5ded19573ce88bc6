#include "pipeline/training/samples/training_recording.h"

#include <string>

#include "manifests/faults.h"
#include "stages/recordings/open_recording.h"

namespace eventgan {
namespace {

std::string size_text(ImageSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

/// What is wrong with the recording; empty if nothing is.
std::string fault_of(const RecordingSpec& spec, const TrainingRecording& opened, ImageSize smallest,
                     int smallest_gap) {
  const Recording& recording = *opened.recording;
  const ImageSize size = recording.size();
  const std::string where = ", in " + opened.file.string();
  if (size.height < smallest.height || size.width < smallest.width) {
    return "expected pictures of at least " + size_text(smallest) + " (crop), got " +
           size_text(size) + where;
  }
  if (spec.last_frame && *spec.last_frame >= recording.frame_count()) {
    return "expected last_frame below the number of frames, " +
           std::to_string(recording.frame_count()) + ", got " + std::to_string(*spec.last_frame) +
           where;
  }
  if (opened.last_frame - opened.first_frame < smallest_gap) {
    return "expected two frames " + std::to_string(smallest_gap) +
           " apart (the smallest of gaps), got frames " + std::to_string(opened.first_frame) +
           " to " + std::to_string(opened.last_frame) + where;
  }
  return "";
}

}  // namespace

std::vector<TrainingRecording> open_training_recordings(std::span<const RecordingSpec> specs,
                                                        const std::filesystem::path& directory,
                                                        ImageSize smallest, int smallest_gap) {
  std::vector<TrainingRecording> recordings;
  std::string faults;
  for (const RecordingSpec& spec : specs) {
    TrainingRecording opened;
    opened.file = directory / spec.path;
    opened.recording = open_recording(opened.file, spec.format, spec.camera);
    opened.weight = spec.weight;
    opened.first_frame = spec.first_frame;
    opened.last_frame = spec.last_frame.value_or(opened.recording->frame_count() - 1);
    const std::string fault = fault_of(spec, opened, smallest, smallest_gap);
    if (!fault.empty()) faults += (faults.empty() ? "" : "\n  ") + fault;
    recordings.push_back(std::move(opened));
  }
  if (!faults.empty()) throw UsageError(faults);
  return recordings;
}

}  // namespace eventgan
