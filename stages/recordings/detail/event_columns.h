#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stages/recordings/detail/stored_recording.h"
#include "stages/recordings/recording.h"

namespace eventgan {

/// Where an HDF5 file has a dataset for each column of its events: whole numbers [events], x and y
/// in pixels, t in µs, p 0 or 1 (or -1 or 1, or a bool).
struct ColumnLayout {
  std::string events;  ///< the group of the columns
  /// Whole numbers [ms]: the first event at or after each ms; empty or absent: there is none.
  std::string ms_index = {};
  std::string t_offset = {};  ///< µs, added to t; likewise
  /// Of the sensor: [width, height], or height and width; likewise.
  std::vector<std::string> size = {};
  std::string ending = {};      ///< of the columns' names: "s" where they are xs, ys, ts, ps
  bool counts_seconds = false;  ///< t is seconds, float

  std::string column(const std::string& name) const { return events + "/" + name + ending; }
};

/// The events and the size, which the options may give. Throws InputError.
StoredParts open_event_columns(const std::filesystem::path& path, const ColumnLayout& layout,
                               const RecordingOptions& options);

/// DSEC's, as EventColumnsWriter writes it, too. Files of RVT and Prophesee (NAME_td.h5) are read
/// as well, which have no index and no offset, but height and width.
ColumnLayout dsec_layout();

/// M3ED's, of one camera: "left" or "right".
ColumnLayout m3ed_layout(const std::string& camera);

/// `path` is a sequence's folder, or its events.h5. The sensor is the options', else what the file
/// says, else, of a file with ms_to_idx and t_offset, 640x480.
///
/// Frames are the PNGs of SEQUENCE/images/left/distorted, as DSEC-Det has them, with the times of
/// SEQUENCE/images/timestamps.txt; with `rectify` those of images/left/rectified. DSEC's own images
/// are of another camera: where they have another size than the sensor, the recording has no
/// frames, and a note says so.
///
/// With `rectify` an event at [y, x] moves to rectify_map[y, x] of rectify_map.h5 beside the
/// events, rounded to a pixel; events that leave the image are left out, and a note tells of how
/// many of the sensor's pixels. Throws InputError.
std::unique_ptr<Recording> open_dsec_recording(const std::filesystem::path& path,
                                               const RecordingOptions& options);

/// Events alone: M3ED's images are of another camera, which a note says. Throws InputError.
std::unique_ptr<Recording> open_m3ed_recording(const std::filesystem::path& path,
                                               const RecordingOptions& options);

}  // namespace eventgan
