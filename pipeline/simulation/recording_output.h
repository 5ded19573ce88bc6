#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "stages/recordings/recording.h"

namespace eventgan {

/// Where a simulated recording goes. As MvsecWriter has them: its calls, what it throws and how its
/// file appears. Not thread safe.
class RecordingOutput {
 public:
  virtual ~RecordingOutput() = default;
  virtual void add_events(std::span<const Event> events) = 0;
  virtual void add_frame(const GreyImage& frame, double time_s,
                         const FlowField* flow_from_previous) = 0;
  virtual void commit() = 0;
};

/// Opens the writer of the file's extension, a word of kSimulatedFileWords. What a format does not
/// have is left out: of AEDAT 4.0 flows, of Prophesee's RAW frames, too; in both times are rounded
/// to microseconds. Throws UsageError for a size that the format does not hold.
std::unique_ptr<RecordingOutput> open_recording_output(const std::filesystem::path& file,
                                                       ImageSize size, const std::string& settings);

/// The settings that a recording on disk was made with; none if there is no such file. Throws
/// InputError if it is no recording of a simulation. Thread safe.
std::optional<std::string> settings_on_disk(const std::filesystem::path& file);

}  // namespace eventgan
