#include <functional>
#include <string>
#include <vector>

#include "pipeline/exports/detail/recordings.h"
#include "stages/recordings/writers/evt3_writer.h"

namespace eventgan {
namespace {

/// raw/SPLIT/RECORDING.raw, and of sources with boxes RECORDING_bbox.npy beside it. Times count
/// from the recording's begin, as those of Prophesee's programs do.
class RawExporter : public RecordingsExporter {
 public:
  using RecordingsExporter::RecordingsExporter;

  void check(const ExportInput& input, const std::function<void()>& check_stop) const override {
    RecordingsExporter::check(input, check_stop);
    require_sides(input, check_stop, Evt3Writer::kLargestSide, "raw");
  }

 private:
  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string name = "raw/" + recording.source->split + "/" + name_before_bbox(recording);
    const std::int64_t clock_us = recording.begin_us();
    Evt3Writer events(step.file(name + ".raw"), recording.shape.size);
    std::vector<RecordedBox> boxes;
    std::string windows;
    for_each([&](const SampleWindow& window, RecordedSample& sample) {
      windows += window_line(window, sample, clock_us);
      for (StampedEvent& event : sample.events) event.t_us -= clock_us;
      events.add_events(sample.events);
      for (RecordedBox& box : sample.boxes) {
        box.t_us -= clock_us;
        boxes.push_back(box);
      }
    });
    events.commit(recording.end_us() - clock_us);
    step.write(name + "_windows.txt", windows);
    if (!recording.source->has_boxes()) return;
    number_tracks(boxes, recording);
    step.write(name + "_bbox.npy", prophesee_boxes(boxes));
  }
};

}  // namespace

ExportFormat raw_format() {
  return {.word = "raw",
          .title = "events as Prophesee's RAW files (EVT 3.0), with its boxes",
          .need = LabelNeed::kNone,
          .tasks = {"object-detection"},
          .options = {"--classes", "--counts", "--frames-per-second", "--seed"},
          .files = {{"raw/SPLIT/RECORDING.raw", "events, EVT 3.0"},
                    {"raw/SPLIT/RECORDING_bbox.npy", kBboxFile},
                    {"raw/SPLIT/RECORDING_windows.txt", kWindowsFile, {{"", kWindowColumns}}},
                    {"label_map_dictionary.json", kClassesFile}},
          .make = make_exporter<RawExporter>};
}

}  // namespace eventgan
