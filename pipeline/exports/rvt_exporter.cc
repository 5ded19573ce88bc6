#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/exports/detail/recordings.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/exports/array_files.h"
#include "stages/exports/volume_file.h"
#include "stages/shards/codec/quantization.h"

namespace eventgan {
namespace {

constexpr ImageSize kGen1{240, 304};

/// Whether anything is left of a box where RVT's loader looks, from 0 to one pixel less than the
/// size: it stops at a box of which nothing is (ObjectLabelBase.clamp_to_frame_, computed here as
/// there).
bool is_in_frame_of_rvt(const Rectangle& box, ImageSize size) {
  const auto length = [](double begin, double end, int side) {
    const auto first = static_cast<float>(begin), extent = static_cast<float>(end - begin);
    const auto last = static_cast<float>(side - 1);
    return std::clamp(first + extent, 0.0f, last) - std::clamp(first, 0.0f, last);
  };
  return length(box.left, box.right, size.width) > 0 &&
         length(box.top, box.bottom, size.height) > 0;
}

/// RVT has the negative polarity first.
std::vector<std::uint16_t> negative_first(const std::vector<float>& volume) {
  std::vector<std::uint16_t> halves(volume.size());
  to_halves(volume, halves.data());
  std::rotate(halves.begin(), halves.begin() + static_cast<std::ptrdiff_t>(halves.size() / 2),
              halves.end());
  return halves;
}

/// What RVT (github.com/uzh-rpg/RVT, commit 515034c; data/genx_utils, scripts/genx) and eTraM's
/// copy of it (github.com/eventbasedvision/eTraM, commit 96bf9cd) read:
///   raw/SPLIT/RECORDING_td.h5, RECORDING_bbox.npy: for scripts/genx/preprocess_dataset.py;
///   preprocessed/SPLIT/RECORDING/...: for its dataset class, a representation for each sample.
/// Times count from the recording's begin.
class RvtExporter : public RecordingsExporter {
 public:
  using RecordingsExporter::RecordingsExporter;

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    RecordingsExporter::account(sample, left_out);
    const ImageSize size = sample.reader.header().volume.size;
    const auto take = [&](const auto&, const VolumeBox& box) {
      if (!is_in_frame_of_rvt(box.clipped, size)) {
        ++left_out["boxes within the last pixel, where RVT's frame ends (in raw alone)"];
      }
    };
    for_each_box(sample, *numbers(), /*keep_ignored=*/false, take, [](const std::string&) {});
  }

 private:
  bool is_labelled(const OutgoingSample& sample) const override {
    bool is_any_left = false;
    const ImageSize size = sample.reader.header().volume.size;
    const auto take = [&](const auto&, const VolumeBox& box) {
      is_any_left |= is_in_frame_of_rvt(box.clipped, size);
    };
    for_each_box(sample, *numbers(), /*keep_ignored=*/false, take, [](const std::string&) {});
    return is_any_left;
  }

  void keep_more(const OutgoingSample& sample, RecordedSample& recorded) const override {
    recorded.volume = sample.reader.volume(sample.slot);
  }

  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string below = recording.source->split + "/" + name_before_bbox(recording);
    const std::int64_t clock_us = recording.begin_us();
    // Of Gen1's size RVT looks for this name.
    const char* ending = recording.shape.size == kGen1 ? "_td.dat.h5" : "_td.h5";
    EventColumnsWriter events(step.file("raw/" + below + ending), ColumnFile::kProphesee,
                              recording.shape.size);
    // RVT has no sequences without labels.
    std::optional<VolumeFile> volumes;
    const std::string representation = fmt::format(
        "preprocessed/{}/event_representations_v2/eventgan_nbins={}/", below, recording.shape.bins);
    if (recording.is_labelled()) {
      volumes.emplace(step.file(representation + "event_representations.h5"), VolumeLayout::kRvt,
                      recording.windows.size(), recording.shape, sizeof(std::uint16_t));
    }
    std::vector<RecordedBox> boxes;
    std::vector<std::int64_t> times_us;
    std::string windows;
    for_each([&](const SampleWindow& window, RecordedSample& sample) {
      windows += window_line(window, sample, clock_us);
      for (StampedEvent& event : sample.events) event.t_us -= clock_us;
      events.add_events(sample.events);
      if (volumes) {
        const std::vector<std::uint16_t> halves = negative_first(sample.volume);
        volumes->write_row(times_us.size(), std::as_bytes(std::span(halves)));
      }
      for (RecordedBox& box : sample.boxes) {
        box.t_us -= clock_us;
        boxes.push_back(box);
      }
      times_us.push_back(window.end_us - clock_us);
    });
    events.commit(recording.end_us() - clock_us);
    step.write("raw/" + below + "_windows.txt", windows);
    if (boxes.empty()) return;
    number_tracks(boxes, recording);
    step.write("raw/" + below + "_bbox.npy", prophesee_boxes(boxes));
    if (!volumes) return;
    volumes->commit();
    step.write(representation + "timestamps_us.npy", npy_file("<i8", {times_us.size()}, times_us));
    write_labels(recording, boxes, "preprocessed/" + below + "/labels_v2/", representation, step);
  }

  /// The frames that have boxes: their times, where in the list of boxes each begins, and which
  /// representation each is of.
  static void write_labels(const OutgoingRecording& recording,
                           const std::vector<RecordedBox>& boxes, const std::string& labels,
                           const std::string& representation, ExportFolder::Step& step) {
    std::vector<RecordedBox> seen;
    std::vector<std::int64_t> times_us, label_index, representation_index;
    std::size_t sample = 0;
    for (const RecordedBox& box : boxes) {
      if (!is_in_frame_of_rvt(box.box, recording.shape.size)) continue;
      if (times_us.empty() || times_us.back() != box.t_us) {
        while (recording.windows.at(sample).label_us - recording.begin_us() != box.t_us) ++sample;
        times_us.push_back(box.t_us);
        label_index.push_back(std::ssize(seen));
        representation_index.push_back(static_cast<std::int64_t>(sample));
      }
      seen.push_back(box);
    }
    const std::vector<std::size_t> frames{times_us.size()};
    step.write(labels + "labels.npz",
               npz_file({{"labels", prophesee_boxes(seen)},
                         {"objframe_idx_2_label_idx", npy_file("<i8", frames, label_index)}}));
    step.write(labels + "timestamps_us.npy", npy_file("<i8", frames, times_us));
    step.write(representation + "objframe_idx_2_repr_idx.npy",
               npy_file("<i8", frames, representation_index));
  }
};

}  // namespace

ExportFormat rvt_format() {
  return {.word = "rvt",
          .title = "the same for RVT and eTraM, as events and as the event volumes",
          .need = LabelNeed::kBoxes,
          .options = {"--classes", "--counts", "--frames-per-second", "--seed"},
          .files = {"raw/SPLIT/RECORDING_td.h5", "raw/SPLIT/RECORDING_td.dat.h5",
                    "raw/SPLIT/RECORDING_bbox.npy", "raw/SPLIT/RECORDING_windows.txt",
                    "preprocessed/SPLIT/RECORDING/labels_v2/labels.npz",
                    "preprocessed/SPLIT/RECORDING/labels_v2/timestamps_us.npy",
                    "preprocessed/SPLIT/RECORDING/event_representations_v2/eventgan_nbins=BINS/"
                    "event_representations.h5",
                    "preprocessed/SPLIT/RECORDING/event_representations_v2/eventgan_nbins=BINS/"
                    "objframe_idx_2_repr_idx.npy",
                    "preprocessed/SPLIT/RECORDING/event_representations_v2/eventgan_nbins=BINS/"
                    "timestamps_us.npy",
                    "label_map_dictionary.json"},
          .make = make_exporter<RvtExporter>};
}

}  // namespace eventgan
