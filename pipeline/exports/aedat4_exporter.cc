#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/recordings.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/preview/preview_reader.h"
#include "stages/recordings/writers/aedat4_writer.h"

namespace eventgan {
namespace {

/// Reads samples' frames as previews show them; as many shards are open as threads read at once.
/// Thread safe.
class FrameReaders {
 public:
  /// Relative frame paths start at `base`.
  explicit FrameReaders(std::filesystem::path base) : base_(std::move(base)) {}

  /// As RecordedSample::frames. Throws InputError for a frame that cannot be read.
  std::array<std::vector<std::uint8_t>, 2> frames(const std::filesystem::path& shard, int slot) {
    std::unique_ptr<Reader> reader = take();
    PreviewContent content = reader->samples.content(shard, slot);
    if (!reader->warnings.empty()) {
      throw InputError(reader->warnings.front() +
                       " (--frames names the folder that frame paths start at, with --overwrite; "
                       "--to raw goes without frames)");
    }
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(reader));
    return {grey_if_so(content.previous_bgr), grey_if_so(content.next_bgr)};
  }

 private:
  struct Reader {
    explicit Reader(const std::filesystem::path& base) : samples(base, warnings) {}

    std::vector<std::string> warnings;
    PreviewReader samples;
  };

  std::unique_ptr<Reader> take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<Reader>(base_);
    std::unique_ptr<Reader> reader = std::move(free_.back());
    free_.pop_back();
    return reader;
  }

  static std::vector<std::uint8_t> grey_if_so(std::vector<std::uint8_t>& bgr) {
    std::vector<std::uint8_t> grey;
    for (std::size_t i = 0; i < bgr.size(); i += 3) {
      if (bgr[i] != bgr[i + 1] || bgr[i] != bgr[i + 2]) return std::move(bgr);
      grey.push_back(bgr[i]);
    }
    return grey;
  }

  std::filesystem::path base_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Reader>> free_;
};

/// aedat4/SPLIT/RECORDING.aedat4, and of sources with boxes RECORDING_bbox.npy beside it. Times are
/// on the sequence's clock; a pair's frames are at the begin and the end of its window.
class Aedat4Exporter : public RecordingsExporter {
 public:
  Aedat4Exporter(const ExportInput& input, const ExportOptions& options)
      : RecordingsExporter(input, options),
        folder_(input.folder()),
        frames_(options.frames.empty() ? options.frames
                                       : std::filesystem::absolute(options.frames / "")),
        readers_(options.frames.empty() ? recorded_manifest_folder(folder_).value_or(folder_)
                                        : frames_) {}

  std::string settings() const override {
    std::string text = RecordingsExporter::settings();
    if (!frames_.empty()) text += "frames " + frames_.lexically_normal().string() + "\n";
    return text;
  }

  void check(const ExportInput& input, const std::function<void()>& check_stop) const override {
    require_sides(input, check_stop, Aedat4Writer::kLargestSide, "aedat4");
  }

 private:
  void keep_more(const OutgoingSample& sample, RecordedSample& recorded) const override {
    recorded.frames = readers_.frames(folder_ / sample.shard.outline.name, sample.slot);
  }

  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string name =
        "aedat4/" + recording.source->split + "/" + name_before_bbox(recording);
    Aedat4Writer file(step.file(name + ".aedat4"), recording.shape.size);
    std::int64_t last_us = -1;  // of a frame: one that two pairs share is there once
    const auto add_frame = [&](std::int64_t t_us, const std::vector<std::uint8_t>& pixels) {
      if (!pixels.empty() && t_us > last_us) file.add_frame(last_us = t_us, pixels);
    };
    std::vector<RecordedBox> boxes;
    std::string windows;
    for_each([&](const SampleWindow& window, const RecordedSample& sample) {
      windows += window_line(window, sample, /*clock_us=*/0);
      add_frame(window.begin_us, sample.frames[0]);
      file.add_events(sample.events);
      add_frame(window.end_us, sample.frames[1]);
      boxes.insert(boxes.end(), sample.boxes.begin(), sample.boxes.end());
    });
    file.commit();
    step.write(name + "_windows.txt", windows);
    if (!recording.source->has_boxes()) return;
    number_tracks(boxes, recording);
    step.write(name + "_bbox.npy", prophesee_boxes(boxes));
  }

  std::filesystem::path folder_;
  std::filesystem::path frames_;  ///< the option's; else empty
  mutable FrameReaders readers_;
};

}  // namespace

ExportFormat aedat4_format() {
  return {.word = "aedat4",
          .title = "the same events and the pairs' frames as AEDAT 4.0, for DV's viewer",
          .need = LabelNeed::kNone,
          .options = {"--classes", "--counts", "--frames", "--frames-per-second", "--seed"},
          .files = {"aedat4/SPLIT/RECORDING.aedat4", "aedat4/SPLIT/RECORDING_bbox.npy",
                    "aedat4/SPLIT/RECORDING_windows.txt", "label_map_dictionary.json"},
          .make = make_exporter<Aedat4Exporter>};
}

}  // namespace eventgan
