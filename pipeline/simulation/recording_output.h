#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// Where a simulated recording goes: its file appears on commit() only, whole. Events and frames
/// come in order of time, a frame behind the events before it, of the size that it was opened with.
/// Members throw std::invalid_argument where a writer sees that they do not, AEDAT 4.0 also for two
/// frames in one microsecond, and std::runtime_error naming the file on I/O errors. Not thread
/// safe.
class RecordingOutput {
 public:
  virtual ~RecordingOutput() = default;
  virtual void add_events(std::span<const Event> events) = 0;
  virtual void add_frame(const GreyImage& frame, double time_s,
                         const FlowField* flow_from_previous) = 0;
  /// `before_publishing` is called once the recording is on disk under another name.
  virtual void commit(const std::function<void()>& before_publishing) = 0;
};

/// Opens the writer of the file's extension, a word of kSimulatedFileWords. What a format does not
/// have is left out: AEDAT 4.0 has no flow, RAW neither flow nor frames; in both times are rounded
/// to microseconds. Throws UsageError for a size that the format does not hold.
std::unique_ptr<RecordingOutput> open_recording_output(const std::filesystem::path& file,
                                                       ImageSize size, const std::string& settings);

/// The settings that a recording on disk was made with; none if there is no such file. Throws
/// InputError if it is no recording of a simulation. Thread safe.
std::optional<std::string> settings_on_disk(const std::filesystem::path& file);

}  // namespace eventgan
