#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string_view>

#include "manifests/values/rows.h"

namespace eventgan {

/// How a recording of an event camera lies on disk (manifests/guides/real_events.md).
enum class RecordingFormat {
  kMvsec,
  kEventgan,
  kEcd,
  kAedat4,
  kAedat3,
  kRosbag,
  kDsec,
  kM3ed,
  kEventUtils,
  kV2e,
  kProphesee,
  kTable
};

/// What manifests, commands and pages may say of a format. What recognises and opens it is in its
/// own file (stages/recordings/readers/detail/recording_reader.h).
struct RecordingFormatRow {
  std::string_view word;  ///< the training manifest's
  RecordingFormat value;
  std::string_view title;    ///< for a person
  std::string_view summary;  ///< what lies there, as a part of a sentence
  /// Frames on the pixels of the events may be there: such recordings train and judge generators.
  bool has_frames;
  /// Those of a manifest's keys "camera", "rectify", "sensor", "stream", "time_shift" and "columns"
  /// that count here; the rest are empty.
  std::array<std::string_view, 3> keys = {};
  /// Of its files, in small letters: `init` looks at no others. Empty: only folders.
  std::array<std::string_view, 3> extensions = {};
};

/// Every format, in the order in which messages list them, and in which it is looked for.
inline constexpr std::array kRecordingFormats{
    RecordingFormatRow{.word = "mvsec",
                       .value = RecordingFormat::kMvsec,
                       .title = "MVSEC",
                       .summary = "HDF5 as MVSEC and `eventgan simulate` write it",
                       .has_frames = true,
                       .keys = {"camera"},
                       .extensions = {".h5", ".hdf5"}},
    RecordingFormatRow{.word = "eventgan",
                       .value = RecordingFormat::kEventgan,
                       .title = "EventGAN",
                       .summary = "HDF5 of the EventGAN authors",
                       .has_frames = true,
                       .extensions = {".h5", ".hdf5"}},
    RecordingFormatRow{.word = "ecd",
                       .value = RecordingFormat::kEcd,
                       .title = "ECD",
                       .summary = "a folder with images.txt and events.txt",
                       .has_frames = true},
    RecordingFormatRow{.word = "aedat4",
                       .value = RecordingFormat::kAedat4,
                       .title = "AEDAT4",
                       .summary = "of iniVation's DV; a DAVIS has frames",
                       .has_frames = true,
                       .keys = {"sensor", "stream"},
                       .extensions = {".aedat4"}},
    RecordingFormatRow{.word = "aedat3",
                       .value = RecordingFormat::kAedat3,
                       .title = "AEDAT3",
                       .summary = "AEDAT 3.1 of cAER; a DAVIS has frames",
                       .has_frames = true,
                       .keys = {"sensor", "stream"},
                       .extensions = {".aedat"}},
    RecordingFormatRow{.word = "rosbag",
                       .value = RecordingFormat::kRosbag,
                       .title = "ROS bag",
                       .summary = "of ROS 1: dvs_msgs or event_camera_msgs; a DAVIS has frames",
                       .has_frames = true,
                       .keys = {"sensor", "stream"},
                       .extensions = {".bag", ".active"}},
    RecordingFormatRow{
        .word = "dsec",
        .value = RecordingFormat::kDsec,
        .title = "DSEC",
        .summary = "DSEC's sequence or its events.h5; frames are images of the events' view",
        .has_frames = true,
        .keys = {"camera", "rectify", "sensor"},
        .extensions = {".h5", ".hdf5"}},
    RecordingFormatRow{.word = "m3ed",
                       .value = RecordingFormat::kM3ed,
                       .title = "M3ED",
                       .summary = "HDF5 of M3ED",
                       .has_frames = false,  // ovc is another camera
                       .keys = {"camera", "sensor"},
                       .extensions = {".h5", ".hdf5"}},
    RecordingFormatRow{.word = "event_utils",
                       .value = RecordingFormat::kEventUtils,
                       .title = "event_utils",
                       .summary = "HDF5 of event_utils, as HQF: events/{xs, ys, ts, ps}, images",
                       .has_frames = true,
                       .keys = {"sensor"},
                       .extensions = {".h5", ".hdf5"}},
    RecordingFormatRow{.word = "v2e",
                       .value = RecordingFormat::kV2e,
                       .title = "v2e",
                       .summary = "HDF5 of v2e (--dvs_h5): events [N, 4] of t in us, x, y, p",
                       .has_frames = true,
                       .keys = {"sensor"},
                       .extensions = {".h5", ".hdf5"}},
    RecordingFormatRow{.word = "prophesee",
                       .value = RecordingFormat::kProphesee,
                       .title = "Prophesee",
                       .summary = "RAW in EVT 2.0, 2.1 or 3.0, or DAT",
                       .has_frames = false,
                       .keys = {"sensor", "time_shift"},
                       .extensions = {".raw", ".dat"}},
    RecordingFormatRow{.word = "table",
                       .value = RecordingFormat::kTable,
                       .title = "table",
                       .summary = "t, x, y and p of each event as .npy, .npz or .csv",
                       .has_frames = false,
                       .keys = {"sensor", "columns"},
                       .extensions = {".npy", ".npz", ".csv"}}};
static_assert(are_in_order(kRecordingFormats));

/// The format's row. Throws std::invalid_argument for a number that is no format, which only a bad
/// cast can make.
constexpr const RecordingFormatRow& recording_format_row(RecordingFormat format) {
  for (const RecordingFormatRow& row : kRecordingFormats) {
    if (row.value == format) return row;
  }
  throw std::invalid_argument("expected a format of recordings, got another number");
}

constexpr bool takes(const RecordingFormatRow& row, std::string_view key) {
  return std::ranges::find(row.keys, key) != row.keys.end();
}

/// Those that may have frames.
inline constexpr auto kFrameFormats = [] {
  constexpr auto kHasFrames = &RecordingFormatRow::has_frames;
  constexpr std::size_t kCount = std::ranges::count(kRecordingFormats, true, kHasFrames);
  std::array<RecordingFormatRow, kCount> rows{};
  std::ranges::copy_if(kRecordingFormats, rows.begin(), std::identity(), kHasFrames);
  return rows;
}();

}  // namespace eventgan
