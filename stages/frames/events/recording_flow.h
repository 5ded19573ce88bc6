#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/recording_formats.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// Begin (exclusive) and end of a window in seconds.
using Span = std::array<double, 2>;

/// Ground truth of optical flow of a recording: maps, each from one time to another.
struct RecordingFlow {
  std::vector<Span> times_s;  ///< from and to of each; ascending, from before to
  /// A map by its number, at the pixels and the time that it begins at. Throws InputError. May be
  /// called from several threads.
  std::function<SourceFlow(std::size_t)> read;
  std::vector<std::filesystem::path> files;  ///< that it comes from
  bool is_of_unknown_view = false;  ///< nothing tells whether the events are rectified, as it is

  /// The map that begins within so many seconds of a time; none if there is none.
  std::optional<std::size_t> map_from(double time_s, double tolerance_s) const;
};

/// What is known of a recording:
///   DSEC    SEQUENCE/flow/forward/*.png and forward_timestamps.txt (from and to in µs, as many as
///           images, in the order of their numbers), beside SEQUENCE/events/left; rectified;
///   MVSEC   NAME_gt_flow_dist.npz beside NAME_data.hdf5 (timestamps [N], x_flow_dist and
///           y_flow_dist [N, y, x]: from each time to the next one; known where it is finite and
///           not 0), of the left camera.
/// Neither tells what is hidden later. DSEC's needs `rectify`, unless rectify_map.h5 moves no
/// event or is not there. None of others. `events_file`: as event_file has
/// it, on disk; `size`: the recording's. Throws InputError "expected X, got Y, in PATH" if it is
/// damaged, or another view's.
std::optional<RecordingFlow> open_recording_flow(RecordingFormat format,
                                                 const std::filesystem::path& events_file,
                                                 ImageSize size, const RecordingOptions& options);

/// The name of the file that MVSEC's flow of a recording lies in, beside it.
std::string mvsec_flow_name(const std::filesystem::path& events_file);

}  // namespace eventgan
