#include "stages/recordings/recording.h"

#include <stdexcept>

#include "stages/recordings/ecd_recording_internal.h"
#include "stages/recordings/hdf5_recording_internal.h"

namespace eventgan {

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
