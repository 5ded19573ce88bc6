#include <fmt/core.h>

#include <cstdint>
#include <limits>
#include <set>
#include <string>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/recordings.h"
#include "stages/base/archives/numpy_arrays.h"

namespace eventgan {
namespace {

/// dsec/SPLIT/RECORDING/events/left/events.h5, images/timestamps.txt, windows.txt, and of sources
/// with boxes object_detections/left/tracks.npy: what the scripts of DSEC (github.com/uzh-rpg/DSEC,
/// commit 9ddd029: EventSlicer) and of DSEC-Det (github.com/uzh-rpg/dsec-det, commit db941c2:
/// DSECDirectory, label.py) read.
class DsecExporter : public RecordingsExporter {
 public:
  DsecExporter(const ExportInput& input, const ExportOptions& options)
      : RecordingsExporter(input, options) {
    constexpr int kMost = std::numeric_limits<std::uint8_t>::max();
    if (numbers() != nullptr && !numbers()->names().empty() &&
        numbers()->names().rbegin()->first > kMost) {
      throw UsageError(fmt::format("--classes: expected numbers of at most {} for DSEC, got {}",
                                   kMost, numbers()->names().rbegin()->first));
    }
  }

 private:
  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string folder = "dsec/" + recording.source->split + "/" + recording.name + "/";
    EventColumnsWriter events(step.file(folder + "events/left/events.h5"), ColumnFile::kDsec,
                              recording.shape.size, recording.begin_us());
    std::vector<RecordedBox> boxes;
    std::set<std::int64_t> times_us;
    std::string windows;
    for_each([&](const SampleWindow& window, const RecordedSample& sample) {
      events.add_events(sample.events);
      boxes.insert(boxes.end(), sample.boxes.begin(), sample.boxes.end());
      times_us.insert({window.begin_us, window.label_us, window.end_us});
      windows += window_line(window, sample, /*clock_us=*/0);
    });
    events.commit(recording.end_us());
    std::string timestamps;
    for (const std::int64_t time_us : times_us) timestamps += std::to_string(time_us) + "\n";
    step.write(folder + "images/timestamps.txt", timestamps);
    step.write(folder + "windows.txt", windows);
    if (!recording.source->has_boxes()) return;
    number_tracks(boxes, recording);
    step.write(folder + "object_detections/left/tracks.npy", tracks(boxes));
  }

  static std::string tracks(const std::vector<RecordedBox>& boxes) {
    constexpr char kFields[] =
        "[('t', '<u8'), ('x', '<f8'), ('y', '<f8'), ('h', '<f8'), ('w', '<f8'), "
        "('class_id', '|u1'), ('class_confidence', '<f8'), ('track_id', '<u8')]";
    constexpr std::size_t kRecordBytes = 57;
    std::string rows;
    for (const RecordedBox& box : boxes) {
      put(rows, static_cast<std::uint64_t>(box.t_us));
      put(rows, box.box.left);
      put(rows, box.box.top);
      put(rows, box.box.bottom - box.box.top);
      put(rows, box.box.right - box.box.left);
      put(rows, static_cast<std::uint8_t>(box.class_number));
      put(rows, 1.0);
      put(rows, static_cast<std::uint64_t>(box.track_id));
    }
    return npy_records(kFields, kRecordBytes, rows);
  }
};

}  // namespace

ExportFormat dsec_format() {
  return {.word = "dsec",
          .title = "the same events as recordings in DSEC's layout, with DSEC-Det's tracks",
          .need = LabelNeed::kNone,
          .options = {"--classes", "--counts", "--frames-per-second", "--seed"},
          .files = {"dsec/SPLIT/RECORDING/events/left/events.h5",
                    "dsec/SPLIT/RECORDING/images/timestamps.txt",
                    "dsec/SPLIT/RECORDING/object_detections/left/tracks.npy",
                    "dsec/SPLIT/RECORDING/windows.txt", "label_map_dictionary.json"},
          .make = make_exporter<DsecExporter>};
}

}  // namespace eventgan
