#include "stages/recordings/recording.h"

#include <stdexcept>
#include <system_error>

#include "stages/base/hdf5/detail/hdf5.h"
#include "stages/recordings/detail/ecd_recording.h"
#include "stages/recordings/detail/hdf5_recording.h"

namespace eventgan {

std::optional<RecordingFormat> find_recording_format(const std::filesystem::path& path,
                                                     const std::string& camera) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    const bool has_events = std::filesystem::exists(path / "events.txt", ignored);
    return has_events ? std::optional(RecordingFormat::kEcd) : std::nullopt;
  }
  if (!std::filesystem::is_regular_file(path, ignored)) return std::nullopt;
  const Hdf5Lock lock;
  try {
    const Hdf5Handle file = open_hdf5_file(path);
    if (has_object(file, mvsec_layout(camera).events)) return RecordingFormat::kMvsec;
    if (has_object(file, eventgan_layout().events)) return RecordingFormat::kEventgan;
  } catch (const Hdf5Error&) {  // who opens it says why
  }
  return std::nullopt;
}

std::unique_ptr<Recording> open_recording(const std::filesystem::path& path, RecordingFormat format,
                                          const std::string& camera) {
  switch (format) {
    case RecordingFormat::kMvsec:
      return std::make_unique<Hdf5Recording>(path, mvsec_layout(camera));
    case RecordingFormat::kEventgan:
      return std::make_unique<Hdf5Recording>(path, eventgan_layout());
    case RecordingFormat::kEcd:
      return std::make_unique<EcdRecording>(path);
  }
  throw std::logic_error("unknown recording format");
}

}  // namespace eventgan
