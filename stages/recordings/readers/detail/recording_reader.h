#pragma once

#include <array>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/recording_formats.h"
#include "manifests/values/rows.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// What lies at a path, which all formats look at: it is opened once for them.
class RecordingInput {
 public:
  explicit RecordingInput(std::filesystem::path path);
  ~RecordingInput();
  RecordingInput(const RecordingInput&) = delete;
  RecordingInput& operator=(const RecordingInput&) = delete;

  const std::filesystem::path& path() const { return path_; }
  bool is_folder() const { return is_folder_; }
  /// A file's first 16 KiB; empty if there are none to read.
  std::string_view beginning() const { return beginning_; }
  /// Why it cannot be opened; null if it can.
  const std::exception_ptr& error() const { return error_; }
  /// Whether it begins as an HDF5 file.
  bool is_hdf5() const { return is_hdf5_; }
  /// What the root of an HDF5 file has, by name.
  std::vector<std::string> hdf5_names() const;
  /// Whether it is an HDF5 file that has the object, such as "events/t".
  bool has_hdf5_object(const std::string& object) const;
  /// Whether that is a dataset.
  bool has_hdf5_dataset(const std::string& path) const;

 private:
  struct Hdf5File;

  std::filesystem::path path_;
  bool is_folder_ = false;
  std::string beginning_;
  std::exception_ptr error_;
  bool is_hdf5_ = false;
  std::unique_ptr<const Hdf5File> hdf5_;
};

/// What recognises and opens the recordings of a format. Each format has its own file, which
/// defines its reader.
struct RecordingReader {
  RecordingFormat format;
  /// Whether it is such a recording, by what is in it.
  bool (*fits)(const RecordingInput& input, const RecordingOptions& options);
  /// As the function open_recording.
  std::unique_ptr<Recording> (*open)(const std::filesystem::path& path,
                                     const RecordingOptions& options);
  /// The file with the events in such a folder, which stands for it; if `path` is none, itself.
  /// Null: these recordings are files.
  std::filesystem::path (*event_file)(const std::filesystem::path& path,
                                      const RecordingOptions& options) = nullptr;
  /// As the function event_companions. Null: there are none.
  std::vector<std::filesystem::path> (*companions)(const std::filesystem::path& event_file,
                                                   const RecordingOptions& options) = nullptr;
  /// As the function recording_fault, of what may be of this format; none: it is not. Null: what is
  /// of this format is found to be.
  std::optional<RecordingFault> (*fault)(const RecordingInput& input,
                                         const RecordingOptions& options) = nullptr;
};

extern const RecordingReader kMvsecReader, kEventganReader, kEcdReader, kAedat3Reader,
    kAedat4Reader, kRosbagReader, kDsecReader, kM3edReader, kEventUtilsReader, kV2eReader,
    kPropheseeReader, kTableReader;

/// Every format's, in the order of kRecordingFormats.
inline constexpr auto kRecordingReaders = parts_of<RecordingReader>(
    kRecordingFormats, {{RecordingFormat::kMvsec, &kMvsecReader},
                        {RecordingFormat::kEventgan, &kEventganReader},
                        {RecordingFormat::kEcd, &kEcdReader},
                        {RecordingFormat::kAedat4, &kAedat4Reader},
                        {RecordingFormat::kAedat3, &kAedat3Reader},
                        {RecordingFormat::kRosbag, &kRosbagReader},
                        {RecordingFormat::kDsec, &kDsecReader},
                        {RecordingFormat::kM3ed, &kM3edReader},
                        {RecordingFormat::kEventUtils, &kEventUtilsReader},
                        {RecordingFormat::kV2e, &kV2eReader},
                        {RecordingFormat::kProphesee, &kPropheseeReader},
                        {RecordingFormat::kTable, &kTableReader}});

}  // namespace eventgan
