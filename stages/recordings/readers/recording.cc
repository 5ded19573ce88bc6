#include "stages/recordings/readers/recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/recordings/readers/detail/recording_reader.h"

namespace eventgan {

namespace {

constexpr std::uint64_t kBeginningBytes = 1 << 14;

/// At the file's start, or behind a user's block, at 512 bytes or twice, four times, ... as many.
bool has_hdf5_signature(const InputFile& file) {
  constexpr std::string_view kSignature = "\x89HDF\r\n\x1a\n";
  for (std::uint64_t at = 0; at + kSignature.size() <= file.size_bytes();
       at = std::max<std::uint64_t>(2 * at, 512)) {
    if (file.read(at, kSignature.size()) == kSignature) return true;
  }
  return false;
}

const RecordingReader& reader_of(RecordingFormat format) {
  return **std::ranges::find(kRecordingReaders, format, &RecordingReader::format);
}

}  // namespace

struct RecordingInput::Hdf5File {
  Hdf5Handle file;
};

RecordingInput::RecordingInput(std::filesystem::path path) : path_(std::move(path)) {
  std::error_code ignored;
  is_folder_ = std::filesystem::is_directory(path_, ignored);
  if (is_folder_) return;
  try {
    const InputFile file(path_);
    beginning_ = file.read(0, std::min(file.size_bytes(), kBeginningBytes));
    is_hdf5_ = has_hdf5_signature(file);
    if (!is_hdf5_) return;
    const Hdf5Lock lock;
    hdf5_ = std::make_unique<Hdf5File>(Hdf5File{open_hdf5_file(path_)});
  } catch (const std::runtime_error&) {
    error_ = std::current_exception();
  }
}

RecordingInput::~RecordingInput() = default;

bool RecordingInput::has_hdf5_object(const std::string& object) const {
  const Hdf5Lock lock;
  return hdf5_ && has_object(hdf5_->file, object);
}

bool RecordingInput::has_hdf5_dataset(const std::string& path) const {
  const Hdf5Lock lock;
  if (!has_hdf5_object(path)) return false;
  const Hdf5Handle object(H5Oopen(hdf5_->file, path.c_str(), H5P_DEFAULT), H5Oclose);
  return object >= 0 && H5Iget_type(object) == H5I_DATASET;
}

std::vector<std::string> RecordingInput::hdf5_names() const {
  std::vector<std::string> names;
  if (!hdf5_) return names;
  const Hdf5Lock lock;
  H5G_info_t group;
  if (H5Gget_info(hdf5_->file, &group) < 0) return names;
  constexpr hsize_t kMost = 10;
  for (hsize_t i = 0; i < std::min(group.nlinks, kMost); ++i) {
    std::array<char, 64> name{};
    H5Lget_name_by_idx(hdf5_->file, ".", H5_INDEX_NAME, H5_ITER_INC, i, name.data(), name.size(),
                       H5P_DEFAULT);
    names.emplace_back(name.data());
  }
  return names;
}

namespace {

/// Files that are told by how they begin, but not read, and what makes others of them.
struct ForeignKind {
  std::string_view beginning;
  std::string_view title;
  std::string_view way_out;
};
constexpr std::array kForeignKinds{
    ForeignKind{"#!AER-DAT", "AEDAT of another version than 3.1 and 4.0",
                "jAER or dv-gui write AEDAT4 of it"},
    ForeignKind{"#ROSBAG", "a ROS bag of another version than 2.0", "rosbag fix writes that"},
    ForeignKind{"\x89MCAP", "MCAP", "write its events as a table of t, x, y and p (.npz)"},
    ForeignKind{"Event Stream", "an Event Stream (.es)",
                "write its events as a table of t, x, y and p (.npz)"}};

bool has_own_extension(const std::filesystem::path& path) {
  constexpr std::array kExtensions{".h5", ".hdf5", ".aedat4", ".bag", ".raw", ".dat"};
  return std::ranges::find(kExtensions, path.extension()) != kExtensions.end();
}

}  // namespace

RecordingFault recording_fault(const std::filesystem::path& path, const RecordingOptions& options) {
  const RecordingInput input(path);
  const auto fault = [&](bool is_recording, const std::string& got, const std::string& help = "") {
    return RecordingFault{fmt::format("expected a recording of an event camera{}, got {}, in {}",
                                      help.empty() ? "" : " (" + help + ")", got, path.string()),
                          is_recording};
  };
  if (input.is_folder()) {
    return fault(false,
                 "a folder without events.txt and without events/" + options.camera + "/events.h5");
  }
  if (input.error()) {
    try {
      std::rethrow_exception(input.error());
    } catch (const std::runtime_error& error) {
      return fault(input.is_hdf5() || has_own_extension(path),
                   fmt::format("a file that does not open ({})", error.what()));
    }
  }
  for (const RecordingReader* reader : kRecordingReaders) {
    if (!reader->fault) continue;
    if (auto found = reader->fault(input, options)) return *std::move(found);
  }
  for (const ForeignKind& kind : kForeignKinds) {
    if (!input.beginning().starts_with(kind.beginning)) continue;
    return fault(true, std::string(kind.title), std::string(kind.way_out));
  }
  if (input.has_hdf5_object("CD/events")) {
    return fault(true, "Metavision's HDF5, whose events are packed by ECF",
                 "metavision_file_to_csv writes a table of it, which is read");
  }
  if (input.is_hdf5()) {
    return fault(
        false, fmt::format("HDF5 of another layout, with {}", fmt::join(input.hdf5_names(), ", ")));
  }
  std::vector<std::string_view> titles;
  for (const RecordingFormatRow& row : kRecordingFormats) titles.push_back(row.title);
  return fault(false, "a file of another kind", fmt::format("{}", fmt::join(titles, ", ")));
}

std::optional<RecordingFormat> find_recording_format(const std::filesystem::path& path,
                                                     const RecordingOptions& options) {
  const RecordingInput input(path);
  for (const RecordingReader* reader : kRecordingReaders) {
    if (reader->fits(input, options)) return reader->format;
  }
  return std::nullopt;
}

std::filesystem::path event_file(const std::filesystem::path& path,
                                 const RecordingOptions& options) {
  for (const RecordingReader* reader : kRecordingReaders) {
    if (!reader->event_file) continue;
    if (auto file = reader->event_file(path, options); file != path) return file;
  }
  return path;
}

std::vector<std::filesystem::path> event_companions(const std::filesystem::path& event_file,
                                                    std::optional<RecordingFormat> format,
                                                    const RecordingOptions& options) {
  if (!format) format = find_recording_format(event_file, options);
  const auto companions = format ? reader_of(*format).companions : nullptr;
  return companions ? companions(event_file, options) : std::vector<std::filesystem::path>();
}

std::unique_ptr<Recording> open_recording(const std::filesystem::path& path,
                                          std::optional<RecordingFormat> format,
                                          const RecordingOptions& options) {
  if (!format) format = find_recording_format(path, options);
  if (!format) throw InputError(recording_fault(path, options).reason);
  return reader_of(*format).open(path, options);
}

}  // namespace eventgan
