#include "stages/recordings/recording.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "stages/base/files/input_file.h"
#include "stages/base/hdf5/detail/hdf5.h"
#include "stages/recordings/detail/recording_reader.h"

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
    std::string nobody_asks;
    const auto file = InputFile::open(path_, nobody_asks);
    if (!file) return;
    beginning_ = file->read(0, std::min(file->size_bytes(), kBeginningBytes));
    if (!has_hdf5_signature(*file)) return;
    const Hdf5Lock lock;
    hdf5_ = std::make_unique<Hdf5File>(Hdf5File{open_hdf5_file(path_)});
  } catch (const std::runtime_error&) {  // reported when it is opened
  }
}

RecordingInput::~RecordingInput() = default;

bool RecordingInput::has_hdf5_object(const std::string& object) const {
  const Hdf5Lock lock;
  return hdf5_ && has_object(hdf5_->file, object);
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
  if (!format) {  // reported when it is opened
    std::error_code ignored;
    format = std::filesystem::is_directory(path, ignored) ? RecordingFormat::kEcd
                                                          : RecordingFormat::kMvsec;
  }
  return reader_of(*format).open(path, options);
}

}  // namespace eventgan
