#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/detail/recordings.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/events/representation.h"
#include "stages/exports/array_files.h"
#include "stages/exports/volume_file.h"
#include "stages/shards/codec/quantization.h"

namespace eventgan {
namespace {

constexpr ImageSize kGen1{240, 304}, kGen4{720, 1280};
constexpr std::int64_t kWindow_us = 50'000;  ///< of a representation

// What RVT's scripts/genx/preprocess_dataset.py does with boxes, and when it looks for labels. Of
// Gen1 and Gen4 as its settings have it; of other sizes, which it does not know, as of Gen4.

/// Cuts a box to where RVT's frame ends, one pixel before the image, in float32 as there. Says why
/// RVT has no use for it; nothing if it has.
const char* cut_for_rvt(Rectangle& box, int class_number, ImageSize size, bool is_train) {
  const auto cut = [](double begin, double end, int side) {
    const auto first = static_cast<float>(begin), extent = static_cast<float>(end - begin);
    const auto last = static_cast<float>(side - 1);
    return std::array{std::clamp(first, 0.0f, last), std::clamp(first + extent, 0.0f, last)};
  };
  const auto [left, right] = cut(box.left, box.right, size.width);
  const auto [top, bottom] = cut(box.top, box.bottom, size.height);
  box = {left, top, right, bottom};
  const float width = right - left, height = bottom - top;
  if (size == kGen4 && class_number > 2) return "boxes of classes beyond Gen4's three in RVT";
  const float least = size == kGen1 ? 10 : 5, diagonal = size == kGen1 ? 30 : 0;
  if (width < least || height < least || width * width + height * height < diagonal * diagonal) {
    return "boxes smaller than RVT takes";
  }
  if (is_train && width > static_cast<float>(9 * size.width / 10)) {
    return "boxes wider than RVT takes for train";
  }
  return nullptr;
}

/// A recording as RVT's dataset class has it, in time from the recording's begin.
struct RvtFrames {
  std::vector<std::int64_t> times_us;  ///< of the object frames, which have labels
  std::vector<std::int64_t> places;    ///< the representation of each
  std::vector<std::int64_t> ends_us;   ///< of all representations
};

/// Each window a representation.
RvtFrames sample_frames(const OutgoingRecording& recording) {
  RvtFrames frames;
  for (const SampleWindow& window : recording.windows) {
    if (window.is_labelled) {
      frames.times_us.push_back(window.label_us - recording.begin_us());
      frames.places.push_back(std::ssize(frames.ends_us));
    }
    frames.ends_us.push_back(window.end_us - recording.begin_us());
  }
  return frames;
}

/// From one object frame to the next, in a number of representations.
struct LabelStep {
  double us = 250'000;
  std::int64_t representations = 2;
};

/// As often as Gen1 has labels; else the least multiple of the labels' own interval from 98 ms on.
LabelStep label_step(const std::vector<std::int64_t>& times_us, ImageSize size) {
  if (size == kGen1 || times_us.size() < 2) return {};
  std::vector<std::int64_t> intervals;
  for (std::size_t i = 1; i < times_us.size(); ++i) {
    intervals.push_back(times_us[i] - times_us[i - 1]);
  }
  std::ranges::sort(intervals);
  const std::size_t half = intervals.size() / 2;
  const double median =
      static_cast<double>(intervals[half] + intervals[(intervals.size() - 1) / 2]) / 2;
  const double step_us = std::trunc(std::ceil(98'000 / median) * median);
  return {step_us, std::max<std::int64_t>(std::llround(step_us / kWindow_us), 1)};
}

/// As the script does: representations of 50 ms up to each object frame, those between two of them
/// evenly spread.
RvtFrames rvt_frames(const OutgoingRecording& recording) {
  constexpr std::int64_t kFirst_us = 100'000, kJitter_us = 2'000;
  const std::vector<std::int64_t> times_us = sample_frames(recording).times_us;
  const LabelStep step = label_step(times_us, recording.shape.size);
  RvtFrames frames;
  for (const std::int64_t time_us : times_us) {
    if (time_us < kFirst_us) continue;
    if (frames.times_us.empty()) {
      // The windows that lead there; RVT leaves out the first one.
      const std::int64_t first_us = (time_us - 1) % kWindow_us + 1 + kWindow_us;
      for (std::int64_t end_us = first_us; end_us < time_us; end_us += kWindow_us) {
        frames.ends_us.push_back(end_us);
      }
    } else {
      const std::int64_t last_us = frames.times_us.back();
      const auto since_us = static_cast<double>(time_us - last_us);
      const double steps = std::nearbyint(since_us / step.us);
      if (steps < 1 || std::abs(since_us - steps * step.us) > kJitter_us) continue;
      const std::int64_t count = static_cast<std::int64_t>(steps) * step.representations;
      for (std::int64_t k = 1; k < count; ++k) {
        const double end_us = static_cast<double>(k) * (since_us / static_cast<double>(count)) +
                              static_cast<double>(last_us);
        frames.ends_us.push_back(static_cast<std::int64_t>(end_us));
      }
    }
    frames.times_us.push_back(time_us);
    frames.places.push_back(std::ssize(frames.ends_us));
    frames.ends_us.push_back(time_us);
  }
  return frames;
}

/// RVT has the negative polarity first.
std::vector<std::uint16_t> negative_first(const std::vector<float>& volume) {
  std::vector<std::uint16_t> halves(volume.size());
  to_halves(volume, halves.data());
  std::rotate(halves.begin(), halves.begin() + static_cast<std::ptrdiff_t>(halves.size() / 2),
              halves.end());
  return halves;
}

/// Every second pixel of a channel, the right and lower ones: PyTorch's "nearest-exact".
std::vector<std::byte> halved(const std::vector<std::byte>& values, std::size_t channels,
                              ImageSize size) {
  const auto height = static_cast<std::size_t>(size.height);
  const auto width = static_cast<std::size_t>(size.width);
  std::vector<std::byte> half;
  half.reserve(values.size() / 4);
  for (std::size_t channel = 0; channel < channels; ++channel) {
    for (std::size_t y = 1; y < height; y += 2) {
      for (std::size_t x = 1; x < width; x += 2) {
        half.push_back(values[(channel * height + y) * width + x]);
      }
    }
  }
  return half;
}

/// The histograms of a recording's events, which come in time order: from 50 ms before each end on,
/// both included.
class HistogramFile {
 public:
  HistogramFile(const std::filesystem::path& file, const Representation& representation,
                ImageSize size, const std::vector<std::int64_t>& ends_us)
      : representation_(representation),
        size_(size),
        ends_us_(ends_us),
        values_(static_cast<std::size_t>(channels_of(representation)) * size.pixel_count()),
        file_(file, VolumeLayout::kRvt, ends_us.size(),
              {channels_of(representation) / 2,
               is_halved() ? ImageSize{size.height / 2, size.width / 2} : size},
              number_bytes(representation)) {}

  /// Events, of which no earlier one than `until_us` comes any more.
  void add(const std::vector<StampedEvent>& events, std::int64_t until_us) {
    for (const StampedEvent& event : events) {
      events_.push_back({event.x, event.y, static_cast<double>(event.t_us), event.positive});
    }
    for (; next_ < ends_us_.size() && ends_us_[next_] < until_us; ++next_) {
      const auto end_us = static_cast<double>(ends_us_[next_]);
      const auto first = std::ranges::lower_bound(events_, end_us - kWindow_us, {}, &Event::t_s);
      const auto last = std::ranges::upper_bound(events_, end_us, {}, &Event::t_s);
      represent(std::span(first, last), representation_, size_, std::nullopt, values_);
      file_.write_row(next_, is_halved() ? halved(values_, channels(), size_) : values_);
    }
    const double kept_us =
        static_cast<double>(next_ < ends_us_.size() ? ends_us_[next_] - kWindow_us : until_us);
    events_.erase(events_.begin(), std::ranges::lower_bound(events_, kept_us, {}, &Event::t_s));
  }

  void commit() {
    add({}, std::numeric_limits<std::int64_t>::max());
    file_.commit();
  }

 private:
  bool is_halved() const { return size_ == kGen4; }
  std::size_t channels() const { return values_.size() / size_.pixel_count(); }

  Representation representation_;
  ImageSize size_;
  const std::vector<std::int64_t>& ends_us_;
  std::size_t next_ = 0;
  std::vector<Event> events_;  ///< times in µs, those that a later window may have
  std::vector<std::byte> values_;
  VolumeFile file_;
};

constexpr char kBetween[] = "labels of samples before 0.1 s or between RVT's (in raw alone)";

/// What RVT (github.com/uzh-rpg/RVT, commit 515034c; data/genx_utils, scripts/genx) and eTraM's
/// copy of it (github.com/eventbasedvision/eTraM, commit 96bf9cd) read:
///   raw/SPLIT/RECORDING_td.h5, RECORDING_bbox.npy: for scripts/genx/preprocess_dataset.py;
///   preprocessed/SPLIT/RECORDING/...: what that makes of these files, stacked histograms; or, with
///   --representation volume, each sample's volume.
/// Times count from the recording's begin.
class RvtExporter : public RecordingsExporter {
 public:
  RvtExporter(const ExportInput& input, const ExportOptions& options)
      : RecordingsExporter(input, options) {
    if (options.representation == "volume") return;
    histogram_ = parse_representation(options.representation.value_or("histogram:10"));
    if (histogram_->kind != RepresentationKind::kHistogram) {
      throw UsageError(fmt::format("--representation: expected histogram:T or volume, got {}",
                                   *options.representation));
    }
  }

  std::string settings() const override {
    return RecordingsExporter::settings() +
           (histogram_ ? fmt::format("representation histogram:{}\n", histogram_->number) : "");
  }

  void account(const OutgoingSample& sample, LeftOut& left_out) const override {
    RecordingsExporter::account(sample, left_out);
    for_each_rvt_box(
        sample, [](const Rectangle&) {},
        [&](const std::string& why) { ++left_out[why + " (in raw alone)"]; });
  }

 private:
  /// Calls take(what is left of it in RVT's frame) or leave(why) for each box that is exported.
  template <class Take, class Leave>
  void for_each_rvt_box(const OutgoingSample& sample, const Take& take, const Leave& leave) const {
    const ImageSize size = sample.reader.header().volume.size;
    const auto look = [&](const ClassNumbers::Entry& entry, const VolumeBox& box) {
      Rectangle cut = box.clipped;
      const char* const why = why_not(cut, entry.number, size, sample.source.split);
      why == nullptr ? take(cut) : leave(why);
    };
    for_each_box(sample, *numbers(), /*keep_ignored=*/false, look, [](const std::string&) {});
  }

  /// RVT's loader, which looks from 0 to one pixel less than the size, stops at a box of which
  /// nothing is there (ObjectLabelBase.clamp_to_frame_).
  const char* why_not(Rectangle& box, int class_number, ImageSize size,
                      const std::string& split) const {
    Rectangle cut = box;
    const char* const why = cut_for_rvt(cut, class_number, size, split == "train");
    if (histogram_) {
      box = cut;
      return why;
    }
    return is_empty(cut) ? "boxes within the last pixel, where RVT's frame ends" : nullptr;
  }

  bool is_labelled(const OutgoingSample& sample) const override {
    bool is_any_left = false;
    for_each_rvt_box(
        sample, [&](const Rectangle&) { is_any_left = true; }, [](const std::string&) {});
    return is_any_left;
  }

  void account_recording(const OutgoingRecording& recording, LeftOut& left_out) const override {
    const auto labelled = std::ranges::count_if(recording.windows, &SampleWindow::is_labelled);
    if (histogram_ && labelled > 0) {
      const auto seen = std::ssize(rvt_frames(recording).times_us);
      if (labelled > seen) left_out[kBetween] += labelled - seen;
    }
    RecordingsExporter::account_recording(recording, left_out);
  }

  void keep_more(const OutgoingSample& sample, RecordedSample& recorded) const override {
    if (!histogram_) recorded.volume = sample.reader.volume(sample.slot);
  }

  void write_recording(const OutgoingRecording& recording, const ForEachSample& for_each,
                       ExportFolder::Step& step) const override {
    const std::string below = recording.source->split + "/" + name_before_bbox(recording);
    const std::int64_t clock_us = recording.begin_us();
    const ImageSize size = recording.shape.size;
    // Of Gen1's size RVT looks for this name.
    EventColumnsWriter events(step.file("raw/" + below + (size == kGen1 ? "_td.dat.h5" : "_td.h5")),
                              ColumnFile::kProphesee, size);
    const RvtFrames frames = histogram_ ? rvt_frames(recording) : sample_frames(recording);
    const std::string folder =
        fmt::format("preprocessed/{}/event_representations_v2/{}/", below,
                    histogram_ ? fmt::format("stacked_histogram_dt=50_nbins={}", histogram_->number)
                               : fmt::format("eventgan_nbins={}", recording.shape.bins));
    std::optional<HistogramFile> histograms;
    std::optional<VolumeFile> volumes;
    // RVT has no sequences without labels.
    if (!frames.times_us.empty()) {
      const auto file =
          step.file(folder + (histogram_ && size == kGen4 ? "event_representations_ds2_nearest.h5"
                                                          : "event_representations.h5"));
      if (histogram_) {
        histograms.emplace(file, *histogram_, size, frames.ends_us);
      } else {
        volumes.emplace(file, VolumeLayout::kRvt, frames.ends_us.size(), recording.shape,
                        sizeof(std::uint16_t));
      }
    }
    std::vector<RecordedBox> boxes;
    std::string windows;
    std::size_t row = 0;
    for_each([&](const SampleWindow& window, RecordedSample& sample) {
      windows += window_line(window, sample, clock_us);
      for (StampedEvent& event : sample.events) event.t_us -= clock_us;
      events.add_events(sample.events);
      if (histograms) histograms->add(sample.events, window.end_us - clock_us);
      if (volumes) {
        const std::vector<std::uint16_t> halves = negative_first(sample.volume);
        volumes->write_row(row++, std::as_bytes(std::span(halves)));
      }
      for (RecordedBox& box : sample.boxes) {
        box.t_us -= clock_us;
        boxes.push_back(box);
      }
    });
    events.commit(recording.end_us() - clock_us);
    step.write("raw/" + below + "_windows.txt", windows);
    if (boxes.empty()) return;
    number_tracks(boxes, recording);
    step.write("raw/" + below + "_bbox.npy", prophesee_boxes(boxes));
    if (frames.times_us.empty()) return;
    histograms ? histograms->commit() : volumes->commit();
    const auto numbers = [&](const std::string& name, const std::vector<std::int64_t>& values) {
      step.write(name, npy_file("<i8", {values.size()}, values));
    };
    numbers(folder + "timestamps_us.npy", frames.ends_us);
    numbers(folder + "objframe_idx_2_repr_idx.npy", frames.places);
    const std::string labels = "preprocessed/" + below + "/labels_v2/";
    numbers(labels + "timestamps_us.npy", frames.times_us);
    step.write(labels + "labels.npz", labels_file(recording, boxes, frames.times_us));
  }

  /// The boxes of the object frames, and where those of each begin.
  std::string labels_file(const OutgoingRecording& recording, const std::vector<RecordedBox>& boxes,
                          const std::vector<std::int64_t>& times_us) const {
    std::vector<RecordedBox> seen;
    std::vector<std::int64_t> first;
    for (const std::int64_t time_us : times_us) {
      first.push_back(std::ssize(seen));
      auto next = std::ranges::lower_bound(boxes, time_us, {}, &RecordedBox::t_us);
      for (; next != boxes.end() && next->t_us == time_us; ++next) {
        RecordedBox box = *next;
        if (why_not(box.box, box.class_number, recording.shape.size, recording.source->split) ==
            nullptr) {
          seen.push_back(box);
        }
      }
    }
    return npz_file({{"labels", prophesee_boxes(seen, /*is_padded=*/!histogram_)},
                     {"objframe_idx_2_label_idx", npy_file("<i8", {first.size()}, first)}});
  }

  std::optional<Representation> histogram_;  ///< else each sample's volume
};

}  // namespace

ExportFormat rvt_format() {
  static constexpr char kEventsFile[] = "events/{x, y, p, t, height, width}, microseconds";
  static constexpr char kRepresentationFile[] = "representations of events, [N, channels, H, W]";
  return {.word = "rvt",
          .title = "events for RVT and eTraM, as recordings and as stacked histograms",
          .need = LabelNeed::kBoxes,
          .options = {"--classes", "--counts", "--frames-per-second", "--representation", "--seed"},
          .files = {{"raw/SPLIT/RECORDING_td.h5", kEventsFile},
                    {"raw/SPLIT/RECORDING_td.dat.h5", kEventsFile},
                    {"raw/SPLIT/RECORDING_bbox.npy", kBboxFile},
                    {"raw/SPLIT/RECORDING_windows.txt", kWindowsFile, {{"", kWindowColumns}}},
                    {"preprocessed/SPLIT/RECORDING/labels_v2/labels.npz",
                     "boxes, and the first of each object frame"},
                    {"preprocessed/SPLIT/RECORDING/labels_v2/timestamps_us.npy",
                     "the time of each object frame"},
                    {"preprocessed/SPLIT/RECORDING/event_representations_v2/NAME/"
                     "event_representations.h5",
                     kRepresentationFile},
                    {"preprocessed/SPLIT/RECORDING/event_representations_v2/NAME/"
                     "event_representations_ds2_nearest.h5",
                     kRepresentationFile},
                    {"preprocessed/SPLIT/RECORDING/event_representations_v2/NAME/"
                     "objframe_idx_2_repr_idx.npy",
                     "the representation of each object frame"},
                    {"preprocessed/SPLIT/RECORDING/event_representations_v2/NAME/timestamps_us.npy",
                     "the end of each representation"},
                    {"label_map_dictionary.json", kClassesFile}},
          .make = make_exporter<RvtExporter>};
}

}  // namespace eventgan
