#include "stages/recordings/recording.h"

#include <stdexcept>
#include <system_error>

#include "stages/base/hdf5/detail/hdf5.h"
#include "stages/recordings/detail/aedat4_recording.h"
#include "stages/recordings/detail/ecd_recording.h"
#include "stages/recordings/detail/event_columns.h"
#include "stages/recordings/detail/hdf5_recording.h"
#include "stages/recordings/detail/prophesee_recording.h"
#include "stages/recordings/detail/stored_recording.h"
#include "stages/recordings/detail/table_recording.h"

namespace eventgan {

namespace {

constexpr char kEcdEvents[] = "events.txt";

}  // namespace

std::optional<RecordingFormat> find_recording_format(const std::filesystem::path& path,
                                                     const RecordingOptions& options) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    if (std::filesystem::exists(path / kEcdEvents, ignored)) return RecordingFormat::kEcd;
    if (dsec_events_file(path, options.camera)) return RecordingFormat::kDsec;
    return std::nullopt;
  }
  if (!std::filesystem::is_regular_file(path, ignored)) return std::nullopt;
  if (is_aedat4(path)) return RecordingFormat::kAedat4;
  if (is_prophesee(path)) return RecordingFormat::kProphesee;
  if (path.filename() == kEcdEvents) return RecordingFormat::kEcd;
  if (is_event_table(path, options.columns)) return RecordingFormat::kTable;
  const Hdf5Lock lock;
  try {
    const Hdf5Handle file = open_hdf5_file(path);
    if (has_object(file, mvsec_layout(options.camera).events)) return RecordingFormat::kMvsec;
    if (has_object(file, eventgan_layout().events)) return RecordingFormat::kEventgan;
    if (has_object(file, m3ed_layout(options.camera).events + "/t")) return RecordingFormat::kM3ed;
    if (has_object(file, dsec_layout().events + "/t")) return RecordingFormat::kDsec;
  } catch (const Hdf5Error&) {  // who opens it says why
  }
  return std::nullopt;
}

std::filesystem::path event_file(const std::filesystem::path& path,
                                 const RecordingOptions& options) {
  std::error_code ignored;
  if (std::filesystem::exists(path / kEcdEvents, ignored)) return path / kEcdEvents;
  return dsec_events_file(path, options.camera).value_or(path);
}

std::vector<std::filesystem::path> event_companions(const std::filesystem::path& event_file,
                                                    const RecordingOptions& options) {
  if (event_file.filename() == kEcdEvents) return {event_file.parent_path() / "images.txt"};
  if (find_recording_format(event_file, options) == RecordingFormat::kDsec) {
    return dsec_companions(event_file, options);
  }
  return {};
}

std::unique_ptr<Recording> open_recording(const std::filesystem::path& path, RecordingFormat format,
                                          const RecordingOptions& options) {
  switch (format) {
    case RecordingFormat::kMvsec:
      return open_hdf5_recording(path, mvsec_layout(options.camera));
    case RecordingFormat::kEventgan:
      return open_hdf5_recording(path, eventgan_layout());
    case RecordingFormat::kEcd:
      return std::make_unique<EcdRecording>(path.filename() == kEcdEvents ? path.parent_path()
                                                                          : path);
    case RecordingFormat::kAedat4:
      return make_stored_recording(open_aedat4(path));
    case RecordingFormat::kProphesee:
      return make_stored_recording(open_prophesee(path, options.sensor));
    case RecordingFormat::kDsec:
      return open_dsec_recording(path, options);
    case RecordingFormat::kM3ed:
      return open_m3ed_recording(path, options);
    case RecordingFormat::kTable:
      return open_table_recording(path, options);
  }
  throw std::logic_error("unknown recording format");
}

}  // namespace eventgan
