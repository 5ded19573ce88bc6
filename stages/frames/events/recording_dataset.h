#pragma once

#include <filesystem>
#include <memory>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// Recordings of an event camera (stages/recordings), with frames or without, with labels or
/// without.
///
/// The root is a recording (a file; a folder of ECD or DSEC) or a folder of recordings, named NAME
/// as its file or folder. Labels are NAME.csv, NAME.json or NAME_bbox.npy (of NAME_td.* as well;
/// read_recording_labels) beside it, of a table NAME.txt as well (read_window_labels), or what the
/// manifest's `annotations` names; a manifest of this program that has such a name is left alone. A
/// sample is a labelled time, of NAME.txt that of the last event or, in the middle, of the middle
/// of all; of a source without labels the time of a frame, or, of recordings without frames, of one
/// of the windows of duration_s that follow each other from a quarter of a microsecond before the
/// first event until all events are in one. Of a source with labels, recordings without are left
/// out, with a note.
///
/// The window of a time t, which lies at its end (SourceSpec::window):
///   frames      (t - d, t], d the interval between the two frames around t, or next to it beyond
///               them; for a frame's own time it begins exactly at the frame before;
///   duration_s  (t - duration_s, t];
///   neither, of NAME.txt: all events;
///   events      the last so many events with a time ≤ t.
/// With t in its middle it is shifted by half of its length, of n events by the later n - n/2. A
/// label within a microsecond of a frame has the frame's time. A time outside the recording's
/// frames and events is at fault. Times within two microseconds of each other are one sample, at
/// fault. Windows before or after all events are noted, and warned of where all of a recording's
/// are. A recording with neither events nor frames is a still scene: any label is within it, and
/// without labels it is one window from 0 on; a warning counts them. Of NAME_bbox.npy, boxes that
/// lie outside the sensor or have no size are left out, with a warning that counts them.
///
/// sample_id is NAME/SECONDS with six decimals, and the same two are in label_key. FrameRef::path
/// is the recording's event_file, and FrameRef::video_frame the last frame at or
/// before the time, -1 if there is none.
///
/// Relative paths start at `base`. Throws InputError if there is no recording, or one or its labels
/// cannot be read; UsageError if `annotations` does not fit.
std::unique_ptr<Dataset> open_recording_dataset(const SourceSpec& spec,
                                                const std::filesystem::path& base);

extern const DatasetReader kRecordingReader;

}  // namespace eventgan
