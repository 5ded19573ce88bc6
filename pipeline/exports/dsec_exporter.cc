#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/recordings.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/images/image_file.h"

namespace eventgan {
namespace {

/// dsec/SPLIT/RECORDING/events/left/events.h5, images/timestamps.txt, windows.txt, and of sources
/// with boxes object_detections/left/tracks.npy: what the scripts of DSEC (github.com/uzh-rpg/DSEC,
/// commit 9ddd029: EventSlicer) and of DSEC-Det (github.com/uzh-rpg/dsec-det, commit db941c2:
/// DSECDirectory, label.py) read. And of samples with flow flow/forward, or, where the labelled
/// image is a pair's next one, flow/backward, as DSEC's own (dsec.ifi.uzh.ch, "Data format").
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
  void keep_more(const OutgoingSample& sample, RecordedSample& recorded) const override {
    recorded.flow = sample.labels.flow;
  }

  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string folder = "dsec/" + recording.source->split + "/" + recording.name + "/";
    EventColumnsWriter events(step.file(folder + "events/left/events.h5"), ColumnFile::kDsec,
                              recording.shape.size, recording.begin_us());
    std::vector<RecordedBox> boxes;
    std::set<std::int64_t> times_us;
    std::string windows;
    std::array<FlowFiles, 2> flow{FlowFiles{folder + "flow/backward"},
                                  FlowFiles{folder + "flow/forward"}};
    for_each([&](const SampleWindow& window, const RecordedSample& sample) {
      if (!sample.flow.empty()) {
        flow[window.label_us == window.begin_us].add(window, sample, recording.shape.size, step);
      }
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
    for (const FlowFiles& files : flow) files.finish(step);
    if (!recording.source->has_boxes()) return;
    number_tracks(boxes, recording);
    step.write(folder + "object_detections/left/tracks.npy", tracks(boxes));
  }

  /// FOLDER/000000.png and so on, and FOLDER_timestamps.txt.
  class FlowFiles {
   public:
    explicit FlowFiles(std::string folder) : folder_(std::move(folder)) {}

    void add(const SampleWindow& window, const RecordedSample& sample, ImageSize size,
             ExportFolder::Step& step) {
      const bool is_forward = window.label_us == window.begin_us;
      const std::int64_t other_us = is_forward ? window.end_us : window.begin_us;
      step.write(fmt::format("{}/{:06}.png", folder_, count_++),
                 encode_wide_png(size, numbers_of(sample.flow, is_forward ? 1 : -1)));
      times_ += fmt::format("{}, {}\n", window.label_us, other_us);
    }

    void finish(ExportFolder::Step& step) const {
      if (count_ == 0) return;
      step.write(folder_ + "_timestamps.txt", "# from_timestamp_us, to_timestamp_us\n" + times_);
    }

   private:
    /// x and y as 2^15 + 128 px, and 1 where they are valid.
    static std::vector<std::uint16_t> numbers_of(const PixelFlow& flow, double sign) {
      constexpr double kZero = 32768, kSteps = 128;
      const std::size_t pixels = flow.valid.size();
      std::vector<std::uint16_t> numbers;
      numbers.reserve(3 * pixels);
      for (std::size_t i = 0; i < pixels; ++i) {
        bool fits = true;
        for (const float px : {flow.px[i], flow.px[pixels + i]}) {
          const double number = std::nearbyint(kZero + kSteps * sign * px);
          fits &= number >= 0 && number < 2 * kZero;
          numbers.push_back(static_cast<std::uint16_t>(std::clamp(number, 0.0, 2 * kZero - 1)));
        }
        numbers.push_back(fits && flow.valid[i] != 0);
      }
      return numbers;
    }

    std::string folder_;
    int count_ = 0;
    std::string times_;
  };

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
                    "dsec/SPLIT/RECORDING/flow/forward/N.png",
                    "dsec/SPLIT/RECORDING/flow/forward_timestamps.txt",
                    "dsec/SPLIT/RECORDING/flow/backward/N.png",
                    "dsec/SPLIT/RECORDING/flow/backward_timestamps.txt",
                    "dsec/SPLIT/RECORDING/windows.txt", "label_map_dictionary.json"},
          .make = make_exporter<DsecExporter>};
}

}  // namespace eventgan
