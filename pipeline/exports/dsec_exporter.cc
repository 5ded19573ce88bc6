#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/frame_readers.h"
#include "pipeline/exports/detail/recordings.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/source_flow.h"

namespace eventgan {
namespace {

/// Events at half the size, as DAGr's scripts/downsample_events.py has them
/// (github.com/uzh-rpg/dagr): each 2 x 2 pixels have a sum, to which an event adds a quarter of its
/// polarity, +1 or -1; one that makes the sum 1 or -1 passes, and the sum is 0 again. The last row
/// or column of an odd size has no 2 x 2 pixels.
class HalfSize {
 public:
  explicit HalfSize(ImageSize size)
      : size_{std::max(size.height / 2, 1), std::max(size.width / 2, 1)},
        quarters_(size_.pixel_count()) {}

  ImageSize size() const { return size_; }

  /// Those that pass, the next in time order.
  std::vector<StampedEvent> passed(std::span<const StampedEvent> events) {
    constexpr int kWhole = 4;
    std::vector<StampedEvent> passed;
    for (StampedEvent event : events) {
      event.x /= 2;
      event.y /= 2;
      if (event.x >= size_.width || event.y >= size_.height) continue;
      std::int8_t& sum = quarters_[static_cast<std::size_t>(event.y * size_.width + event.x)];
      sum = static_cast<std::int8_t>(sum + (event.positive ? 1 : -1));
      if (std::abs(sum) < kWhole) continue;
      sum = 0;
      passed.push_back(event);
    }
    return passed;
  }

 private:
  ImageSize size_;
  std::vector<std::int8_t> quarters_;
};

/// Whether an image of flow can tell so many pixels of motion, in either direction.
bool fits_flow(float px) { return std::abs(std::nearbyint(kDsecFlowSteps * px)) < 32768; }

/// dsec/SPLIT/RECORDING/events/left/events.h5 and events_2x.h5, images/timestamps.txt and
/// left/distorted, windows.txt, and of sources with boxes object_detections/left/tracks.npy: what
/// the scripts of DSEC (github.com/uzh-rpg/DSEC, commit 9ddd029: EventSlicer), of DSEC-Det
/// (github.com/uzh-rpg/dsec-det, commit db941c2: DSECDet) and of DAGr read. And of samples with
/// flow flow/forward, or, where the labelled image is a pair's next one, flow/backward, as DSEC's
/// own (dsec.ifi.uzh.ch, "Data format"), and the rectify_map.h5 that its loaders open.
class DsecExporter : public RecordingsExporter {
 public:
  DsecExporter(const ExportInput& input, const ExportOptions& options)
      : RecordingsExporter(input, options), frames_(input, options) {
    constexpr int kMost = std::numeric_limits<std::uint8_t>::max();
    if (numbers() != nullptr && !numbers()->names().empty() &&
        numbers()->names().rbegin()->first > kMost) {
      throw UsageError(fmt::format("--classes: expected numbers of at most {} for DSEC, got {}",
                                   kMost, numbers()->names().rbegin()->first));
    }
  }

  std::string settings() const override {
    return RecordingsExporter::settings() + frames_.settings();
  }

  void finish(const ExportWork& work,
              const std::vector<const ExportShard*>& shards) const override {
    without_frames_.clear();
    std::set<int> seen;
    for (const ExportShard* shard : shards) {
      if (shard->valid > 0 && seen.insert(shard->outline.source).second)
        look_for_frames(work, *shard);
    }
    RecordingsExporter::finish(work, shards);
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    RecordingsExporter::account(sample, left_out);
    const PixelFlow& flow = sample.labels.flow;
    const std::size_t pixels = flow.valid.size();
    std::int64_t far = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const bool fits = fits_flow(flow.px[i]) && fits_flow(flow.px[pixels + i]);
      far += flow.valid[i] != 0 && !fits ? 1 : 0;
    }
    if (far > 0)
      left_out["pixels of flow of 256 px or more, which DSEC's images do not hold"] += far;
  }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = RecordingsExporter::notes();
    for (const auto& [source, reason] : without_frames_) {
      notes.push_back(fmt::format(
          "no images of {} in split {}: {} (--frames names the folder that frame paths start at, "
          "with --overwrite)",
          source->dataset, source->split, reason));
    }
    return notes;
  }

 private:
  /// Of a source whose first sample's frames cannot be read there are no images; those of a later
  /// one must be there.
  void look_for_frames(const ExportWork& work, const ExportShard& shard) const {
    const ShardReader reader = work.input.open(shard);
    bool is_found = false;
    for (int slot = 0; !is_found && slot < reader.header().sample_count; ++slot) {
      work.with_sample(shard, reader, slot, [&](const OutgoingSample& sample) {
        is_found = true;
        const auto frames = frames_.try_frames(sample, /*with_labelled=*/true);
        if (is_fault(frames)) without_frames_[&sample.source] = frames.fault().reason;
      });
    }
  }

  void keep_more(const OutgoingSample& sample, RecordedSample& recorded) const override {
    recorded.flow = sample.labels.flow;
    if (without_frames_.contains(&sample.source)) return;
    recorded.frames = frames_.frames(sample, /*with_labelled=*/true);
  }

  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string folder = "dsec/" + recording.source->split + "/" + recording.name + "/";
    const std::int64_t clock_us = recording.begin_us();
    EventColumnsWriter events(step.file(folder + "events/left/events.h5"), ColumnFile::kDsec,
                              recording.shape.size, clock_us);
    HalfSize half(recording.shape.size);
    EventColumnsWriter half_events(step.file(folder + "events/left/events_2x.h5"),
                                   ColumnFile::kDsec, half.size(), clock_us);
    ImageFiles images(folder + "images/", recording.shape.size);
    std::vector<RecordedBox> boxes;
    std::string windows;
    std::array<FlowFiles, 2> flow{FlowFiles{folder + "flow/backward"},
                                  FlowFiles{folder + "flow/forward"}};
    for_each([&](const SampleWindow& window, const RecordedSample& sample) {
      if (!sample.flow.empty()) {
        flow[window.label_us == window.begin_us].add(window, sample, recording.shape.size, step);
      }
      events.add_events(sample.events);
      half_events.add_events(half.passed(sample.events));
      boxes.insert(boxes.end(), sample.boxes.begin(), sample.boxes.end());
      images.add(window.begin_us, sample.frames.previous_bgr, step);
      if (window.label_us < window.end_us) {
        images.add(window.label_us, sample.frames.labelled_bgr, step);
      }
      images.add(window.end_us, sample.frames.next_bgr, step);
      windows += window_line(window, sample, /*clock_us=*/0);
    });
    events.commit(recording.end_us());
    half_events.commit(recording.end_us());
    images.finish(step);
    step.write(folder + "windows.txt", windows);
    for (const FlowFiles& files : flow) files.finish(step);
    if (std::ranges::any_of(flow, &FlowFiles::has_files)) {  // loaders of flow rectify the events
      write_rectify_map(step.file(folder + "events/left/rectify_map.h5"), recording.shape.size);
    }
    if (!recording.source->has_boxes()) return;
    number_tracks(boxes, recording);
    step.write(folder + "object_detections/left/tracks.npy", tracks(boxes));
  }

  /// timestamps.txt, and for each of its lines left/distorted/000000.png and so on, which have the
  /// events' pixels; none if no frame is known. One that is not known among others is black.
  class ImageFiles {
   public:
    ImageFiles(std::string folder, ImageSize size) : folder_(std::move(folder)), size_(size) {}

    /// A time that was there already is the same frame.
    void add(std::int64_t time_us, const std::vector<std::uint8_t>& bgr, ExportFolder::Step& step) {
      if (count_ > 0 && time_us <= last_us_) return;
      last_us_ = time_us;
      times_ += std::to_string(time_us) + "\n";
      ++count_;
      if (bgr.empty()) return;
      write_black(count_ - 1, step);
      write(bgr, step);
    }

    void finish(ExportFolder::Step& step) {
      if (written_ > 0) write_black(count_, step);
      step.write(folder_ + "timestamps.txt", times_);
    }

   private:
    void write(const std::vector<std::uint8_t>& bgr, ExportFolder::Step& step) {
      step.write(fmt::format("{}left/distorted/{:06}.png", folder_, written_++),
                 encode_png({size_, bgr.data()}));
    }

    void write_black(int until, ExportFolder::Step& step) {
      while (written_ < until) write(std::vector<std::uint8_t>(3 * size_.pixel_count()), step);
    }

    std::string folder_;
    ImageSize size_;
    std::string times_;
    std::int64_t last_us_ = 0;
    int count_ = 0;    ///< of times
    int written_ = 0;  ///< of images
  };

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

    bool has_files() const { return count_ > 0; }

    void finish(ExportFolder::Step& step) const {
      if (!has_files()) return;
      step.write(folder_ + "_timestamps.txt", "# from_timestamp_us, to_timestamp_us\n" + times_);
    }

   private:
    /// x and y as 2^15 + 128 px, and 1 where they are valid.
    static std::vector<std::uint16_t> numbers_of(const PixelFlow& flow, double sign) {
      constexpr double kZero = 32768;
      const std::size_t pixels = flow.valid.size();
      std::vector<std::uint16_t> numbers;
      numbers.reserve(3 * pixels);
      for (std::size_t i = 0; i < pixels; ++i) {
        const std::array px{flow.px[i], flow.px[pixels + i]};
        for (const float one_px : px) {
          const double number = kZero + std::nearbyint(kDsecFlowSteps * sign * one_px);
          numbers.push_back(static_cast<std::uint16_t>(std::clamp(number, 0.0, 2 * kZero - 1)));
        }
        numbers.push_back(std::ranges::all_of(px, fits_flow) && flow.valid[i] != 0);
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

  mutable FrameReaders frames_;
  // Of `finish`:
  mutable std::map<const ExportSource*, std::string> without_frames_;  ///< and why
};

}  // namespace

ExportFormat dsec_format() {
  static constexpr char kFlowFile[] = "optical flow, 16 bits: 2^15 + 128 px, valid";
  static constexpr char kFlowTimesFile[] = "from, to, microseconds";
  return {
      .word = "dsec",
      .title = "events, frames and boxes in DSEC's layout, for DSEC-Det and DAGr",
      .need = LabelNeed::kNone,
      .tasks = {"object-detection"},
      .options = {"--classes", "--counts", "--frames", "--frames-per-second", "--seed"},
      .files = {{"dsec/SPLIT/RECORDING/events/left/events.h5",
                 "events/{x, y, t, p}, ms_to_idx, t_offset"},
                {"dsec/SPLIT/RECORDING/events/left/events_2x.h5", "the same at half the size"},
                {"dsec/SPLIT/RECORDING/events/left/rectify_map.h5",
                 "beside flow: rectify_map [H, W, 2], each pixel's place, itself"},
                {"dsec/SPLIT/RECORDING/images/timestamps.txt",
                 "the time of each image, microseconds",
                 {{"", "time_us:Integer"}}},
                {"dsec/SPLIT/RECORDING/images/left/distorted/N.png", "images of the events' view"},
                {"dsec/SPLIT/RECORDING/object_detections/left/tracks.npy",
                 "boxes: t, x, y, h, w, class_id, class_confidence, track_id"},
                {"dsec/SPLIT/RECORDING/flow/forward/N.png", kFlowFile},
                {"dsec/SPLIT/RECORDING/flow/forward_timestamps.txt", kFlowTimesFile},
                {"dsec/SPLIT/RECORDING/flow/backward/N.png", kFlowFile},
                {"dsec/SPLIT/RECORDING/flow/backward_timestamps.txt", kFlowTimesFile},
                {"dsec/SPLIT/RECORDING/windows.txt", kWindowsFile, {{"", kWindowColumns}}},
                {"label_map_dictionary.json", kClassesFile}},
      .make = make_exporter<DsecExporter>};
}

}  // namespace eventgan
