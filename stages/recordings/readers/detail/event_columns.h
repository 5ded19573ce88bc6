#pragma once

#include <filesystem>
#include <memory>

#include "stages/recordings/readers/detail/stored_recording.h"
#include "stages/recordings/readers/hdf5_layouts.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// The events and the size, which the options may give. Throws InputError.
StoredParts open_event_columns(const std::filesystem::path& path, const ColumnLayout& layout,
                               const RecordingOptions& options);

/// `path` is a sequence's folder, or its events.h5. The sensor is the options', else what the file
/// says (events/height and events/width, or attributes), else, of a file with ms_to_idx and
/// t_offset, one that its events reach, which a note says. `ms_to_idx` is not needed: a note says
/// if it does not fit.
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
