#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/exports/detail/frame_readers.h"
#include "pipeline/exports/detail/recordings.h"
#include "stages/recordings/writers/aedat4_writer.h"

namespace eventgan {
namespace {

/// [y, x, channel] as [y, x] if no pixel has a colour.
std::vector<std::uint8_t> grey_if_so(const std::vector<std::uint8_t>& bgr) {
  std::vector<std::uint8_t> grey;
  for (std::size_t i = 0; i < bgr.size(); i += 3) {
    if (bgr[i] != bgr[i + 1] || bgr[i] != bgr[i + 2]) return bgr;
    grey.push_back(bgr[i]);
  }
  return grey;
}

/// aedat4/SPLIT/RECORDING.aedat4, and of sources with boxes RECORDING_bbox.npy beside it. Times are
/// on the sequence's clock; a pair's frames are at the begin and the end of its window.
class Aedat4Exporter : public RecordingsExporter {
 public:
  Aedat4Exporter(const ExportInput& input, const ExportOptions& options)
      : RecordingsExporter(input, options), frames_(input, options) {}

  std::string settings() const override {
    return RecordingsExporter::settings() + frames_.settings();
  }

  void check(const ExportInput& input, const std::function<void()>& check_stop) const override {
    RecordingsExporter::check(input, check_stop);
    require_sides(input, check_stop, Aedat4Writer::kLargestSide, "aedat4");
  }

 private:
  void keep_more(const OutgoingSample& sample, RecordedSample& recorded) const override {
    recorded.frames = frames_.frames(sample, /*with_labelled=*/false);
  }

  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string name =
        "aedat4/" + recording.source->split + "/" + name_before_bbox(recording);
    Aedat4Writer file(step.file(name + ".aedat4"), recording.shape.size);
    std::int64_t last_us = -1;  // of a frame: one that two pairs share is there once
    const auto add_frame = [&](std::int64_t t_us, const std::vector<std::uint8_t>& bgr) {
      if (!bgr.empty() && t_us > last_us) file.add_frame(last_us = t_us, grey_if_so(bgr));
    };
    std::vector<RecordedBox> boxes;
    std::string windows;
    for_each([&](const SampleWindow& window, const RecordedSample& sample) {
      windows += window_line(window, sample, /*clock_us=*/0);
      add_frame(window.begin_us, sample.frames.previous_bgr);
      file.add_events(sample.events);
      add_frame(window.end_us, sample.frames.next_bgr);
      boxes.insert(boxes.end(), sample.boxes.begin(), sample.boxes.end());
    });
    file.commit();
    step.write(name + "_windows.txt", windows);
    if (!recording.source->has_boxes()) return;
    number_tracks(boxes, recording);
    step.write(name + "_bbox.npy", prophesee_boxes(boxes));
  }

  mutable FrameReaders frames_;
};

}  // namespace

ExportFormat aedat4_format() {
  return {.word = "aedat4",
          .title = "events and the pairs' frames as AEDAT 4.0, for DV's viewer",
          .need = LabelNeed::kNone,
          .tasks = {"object-detection"},
          .options = {"--classes", "--counts", "--frames", "--frames-per-second", "--seed"},
          .files = {{"aedat4/SPLIT/RECORDING.aedat4", "events and frames, AEDAT 4.0"},
                    {"aedat4/SPLIT/RECORDING_bbox.npy", kBboxFile},
                    {"aedat4/SPLIT/RECORDING_windows.txt", kWindowsFile, {{"", kWindowColumns}}},
                    {"label_map_dictionary.json", kClassesFile}},
          .make = make_exporter<Aedat4Exporter>};
}

}  // namespace eventgan
