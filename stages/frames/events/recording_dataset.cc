#include "stages/frames/events/recording_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <exception>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/events/recording_flow.h"
#include "stages/frames/events/recording_folder.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr double kSameTime_s = 1e-6;  // what labels written with six decimals can lose
/// An event at a window's begin is not in it, and none at whole microseconds lies on the border of
/// two windows that begin so long before one.
constexpr double kJustBefore_s = kSameTime_s / 4;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Consecutive windows from `begin_s` on.
struct Windows {
  double begin_s = 0;
  std::int64_t count = 0;
};

/// One recording of the source.
struct Recorded : FoundFile {
  std::unique_ptr<Recording> recording;
  std::vector<double> frame_times_s;
  std::array<double, 2> span{};                     ///< first and last time of a frame or an event
  std::optional<std::array<double, 2>> event_span;  ///< of an event; none: there are none
  Windows windows;                                  ///< if it has neither frames nor labels
  RecordingLabels labels;                           ///< class_id is the source's
  std::optional<RecordingFlow> flow;                ///< whose times are its windows

  /// Whether it is one window, whose labels have no time.
  bool is_window() const { return is_window_label_file(label_file); }

  /// The last frame at or before the time; -1 if there is none.
  std::int64_t frame_at(double time_s) const {
    return std::ranges::upper_bound(frame_times_s, time_s) - frame_times_s.begin() - 1;
  }

  FrameRef ref(double time_s) const {
    const std::int64_t frame = frame_at(time_s);
    return {path, frame, frame, time_s};
  }
};

/// Begin (exclusive) and end of a window in seconds.
using Span = std::array<double, 2>;

/// `time_s` + `length_s`. Of whole microseconds, or nanoseconds, the same number as the time of an
/// event that is stored so: whether it is in a window is not for rounding to say.
double later(double time_s, double length_s) {
  for (const double ticks_per_s : {1e6, 1e9}) {
    constexpr double kMostTicks = 9007199254740992;  // 2^53: beyond it a double has not all
    const double time = std::round(time_s * ticks_per_s);
    const double length = std::round(length_s * ticks_per_s);
    const double rounding = 4 * std::numeric_limits<double>::epsilon() * std::abs(length_s);
    if (std::abs(time) < kMostTicks && time / ticks_per_s == time_s &&
        std::abs(length / ticks_per_s - length_s) <= rounding) {
      return (time + length) / ticks_per_s;
    }
  }
  return time_s + length_s;
}

/// The window of a time by the frames around it.
Span frame_window(const std::vector<double>& frames, double time_s, LabelPlace place) {
  const auto after = std::ranges::lower_bound(frames, time_s);
  const std::ptrdiff_t last =
      std::clamp<std::ptrdiff_t>(after - frames.begin(), 1, std::ssize(frames) - 1);
  const double before_s = frames[static_cast<std::size_t>(last) - 1];
  const double last_s = frames[static_cast<std::size_t>(last)];
  if (place == LabelPlace::kMiddle) {
    const double half_s = later(last_s, -before_s) / 2;
    return {later(time_s, -half_s), later(time_s, half_s)};
  }
  return {later(later(time_s, -last_s), before_s), time_s};
}

/// What lies beside a file, or near it, written as that one is.
std::string written_beside(const fs::path& beside, const fs::path& file,
                           const std::string& written_file) {
  const auto normal = [](const fs::path& path) { return fs::absolute(path).lexically_normal(); };
  const fs::path from_file = normal(beside).lexically_relative(normal(file).parent_path());
  fs::path written = fs::path(written_file).parent_path() / from_file;
  if (from_file.has_parent_path()) written = written.lexically_normal();  // left/../../images
  return written.generic_string();
}

class RecordingDataset final : public Dataset {
 public:
  RecordingDataset(const SourceSpec& spec, const fs::path& base)
      : window_(spec.window), options_(spec.recording), reads_flow_(spec.flow) {
    RecordingFolder found = look_into_recordings(spec, base);
    notes_ = std::move(found.notes);
    unreadable_ = std::move(found.unreadable);
    unopened_ = std::move(found.unopened);
    for (auto& [name, file] : found.recordings) {
      static_cast<FoundFile&>(recordings_[name]) = std::move(file);
    }
    read_labels();
    open_all(base, spec.root);
    number_classes();
    for (const auto& [name, recorded] : recordings_) {
      const std::size_t first = labelled_.size();
      list_times(name, recorded);
      compare_clocks(recorded, std::span(labelled_).subspan(first));
    }
    tell_counts();
    if (labelled_.empty()) {
      throw InputError("expected labels or frames to make samples of, got none, in " + spec.root);
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
    annotation_files_.erase(std::unique(annotation_files_.begin(), annotation_files_.end()),
                            annotation_files_.end());
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = notes_;
    for (const auto& [name, recorded] : recordings_) {
      std::ranges::move(recorded.recording->warnings(), std::back_inserter(notes));
      std::ranges::move(recorded.recording->notes(), std::back_inserter(notes));
    }
    return notes;
  }

  std::vector<std::string> warnings() const override {
    std::vector<std::string> warnings = warnings_;
    for (const auto& [name, recorded] : recordings_) {
      std::ranges::move(recorded.recording->warnings(), std::back_inserter(warnings));
    }
    return warnings;
  }

  Unreadable unreadable() const override {
    return {unreadable_, std::ssize(unreadable_) + std::ssize(recordings_)};
  }

  PairedFrame paired_frame(const LabelledFrame& labelled, int steps) const override {
    if (steps == 0) return {PairedFrame::State::kPresent, labelled.frame};
    if (steps != 1 && steps != -1) return {};
    const Recorded& recorded = recordings_.at(labelled.sequence);
    FrameRef edge = labelled.frame;
    if (const std::optional<Span> span = span_of(recorded, labelled.frame.time_s)) {
      edge = recorded.ref((*span)[steps < 0 ? 0 : 1]);
    } else {
      edge.time_s = kNan;
    }
    return {PairedFrame::State::kPresent, std::move(edge)};
  }

  ImageSize sensor_size(const std::string& label_key) const override {
    return find(label_key).first.recording->size();
  }

  Outcome<EventWindow> events(const std::string& label_key) const override try {
    const auto& [recorded, time_s] = find(label_key);
    const Recording& recording = *recorded.recording;
    EventWindow window{recording.size(), {}};
    if (const std::optional<Span> span = span_of(recorded, time_s)) {
      window.events = recording.events_in((*span)[0], (*span)[1]);
    } else {
      const std::int64_t after =
          window_.label == LabelPlace::kMiddle ? *window_.events - *window_.events / 2 : 0;
      window.events = recording.events_around(time_s, *window_.events - after, after);
    }
    return window;
  } catch (const InputError& error) {
    return SampleFault{error.what()};
  }

  Outcome<SourceFlow> flow(const std::string& label_key) const override try {
    const auto& [recorded, time_s] = find(label_key);
    if (!recorded.flow) return SourceFlow();
    const std::optional<std::size_t> map = recorded.flow->map_from(time_s, kSameTime_s);
    if (map) return recorded.flow->read(*map);
    return SampleFault{"expected flow from " + std::to_string(time_s) + " s, got none, in " +
                       recorded.path};
  } catch (const InputError& error) {
    return SampleFault{error.what()};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override try {
    const auto& [recorded, time_s] = find(label_key);
    if (recorded.label_file.empty()) return Annotation{};
    // The key has the time of the label, or of the frame that it was taken to.
    const auto& labels = recorded.labels.annotations;
    const auto label = labels.lower_bound(time_s - kSameTime_s);
    if (label == labels.end() || label->first > time_s + kSameTime_s) {
      return SampleFault{"expected labels of " + std::to_string(time_s) + " s, got none, in " +
                         recorded.label_file};
    }
    for (const Box& box : label->second.boxes) {  // detectors' losses know none without an area
      const double width = box.xyxy.right - box.xyxy.left;
      const double height = box.xyxy.bottom - box.xyxy.top;
      if (width > 0 && height > 0) continue;
      return SampleFault{
          fmt::format("expected boxes of a width and height above 0, got {:g} x {:g}, in {}", width,
                      height, label_place(label_key))};
    }
    return label->second;
  } catch (const InputError& error) {
    return SampleFault{error.what()};
  }

  std::string label_place(const std::string& label_key) const override try {
    const auto& [recorded, time_s] = find(label_key);
    return fmt::format("{} ({:.6f} s)",
                       recorded.label_file.empty() ? recorded.path : recorded.label_file, time_s);
  } catch (const InputError&) {  // a key that the source does not know any more
    return label_key;
  }

 private:
  /// The recording and the time that a label_key names. Throws InputError if there is none.
  std::pair<const Recorded&, double> find(const std::string& label_key) const {
    const std::size_t slash = std::min(label_key.rfind('/'), label_key.size());
    const auto recorded = recordings_.find(label_key.substr(0, slash));
    double time_s = 0;
    const char* const end = label_key.data() + label_key.size();
    const char* const begin = label_key.data() + std::min(slash + 1, label_key.size());
    const auto [stop, error] = std::from_chars(begin, end, time_s);
    if (const auto reason = unopened_.find(label_key.substr(0, slash)); reason != unopened_.end()) {
      throw InputError(reason->second);
    }
    if (recorded == recordings_.end() || error != std::errc() || stop != end) {
      throw InputError("expected a recording and a time of the source, got " + label_key);
    }
    return {recorded->second, time_s};
  }

  /// None where so many events make the window, whatever their times.
  std::optional<Span> span_of(const Recorded& recorded, double time_s) const {
    if (recorded.flow) {
      const std::optional<std::size_t> map = recorded.flow->map_from(time_s, kSameTime_s);
      return map ? recorded.flow->times_s[*map] : Span{time_s, time_s};
    }
    if (window_.events) return std::nullopt;
    if (!window_.duration_s && recorded.is_window()) {
      return Span{recorded.span[0] - kJustBefore_s, recorded.span[1]};
    }
    if (!window_.duration_s) return frame_window(recorded.frame_times_s, time_s, window_.label);
    if (recorded.windows.count > 0) {
      // From the window's number, so that one's end is the next one's begin to the last bit: no
      // event falls between two.
      const double place = window_.label == LabelPlace::kMiddle ? 0.5 : 1;
      const double begin_s = recorded.windows.begin_s, length_s = *window_.duration_s;
      const double i = std::round((time_s - begin_s) / length_s - place);
      return Span{begin_s + i * length_s, begin_s + (i + 1) * length_s};
    }
    const double after_s = window_.label == LabelPlace::kMiddle ? *window_.duration_s / 2 : 0;
    return Span{later(time_s, after_s - *window_.duration_s), later(time_s, after_s)};
  }

  void read_labels() {
    for (auto& [name, recorded] : recordings_) {
      if (recorded.label_file.empty()) continue;
      const fs::path& file = recorded.label_file_on_disk;
      annotation_files_.push_back(recorded.label_file);
      for (const fs::path& beside : recorded.is_window() ? window_labels_.companions(file)
                                                         : recording_label_companions(file)) {
        annotation_files_.push_back(written_beside(beside, file, recorded.label_file));
      }
      if (!recorded.is_window()) recorded.labels = read_recording_labels(file);
    }
  }

  /// Of several recordings, those that do not open are told of and left out. Labels with mistakes
  /// are not.
  void open_all(const fs::path& base, const std::string& root) {
    std::vector<std::string> without_flow;
    const bool is_one = recordings_.size() + unreadable_.size() == 1;
    std::exception_ptr first;
    for (auto entry = recordings_.begin(); entry != recordings_.end();) {
      try {
        open(entry->second, base);
      } catch (const InputError& error) {
        if (is_one) throw;
        if (!first) first = std::current_exception();
        unreadable_.emplace_back(error.what());
        unopened_[entry->first] = error.what();
        entry = recordings_.erase(entry);
        continue;
      }
      if (reads_flow_ && !entry->second.flow) {
        without_flow.push_back(entry->first);
        entry = recordings_.erase(entry);
        continue;
      }
      if (entry->second.is_window()) read_window(entry->second);
      fit_boxes(entry->second);
      ++entry;
    }
    if (recordings_.empty() && first) std::rethrow_exception(first);
    if (without_flow.empty()) return;
    if (recordings_.empty()) {
      throw InputError("expected flow beside a recording of DSEC or MVSEC, got none, in " + root);
    }
    notes_.push_back(counted(without_flow, "recording", " without flow left out in " + root));
  }

  void open(Recorded& recorded, const fs::path& base) {
    const fs::path path = base / recorded.path;
    const fs::path own = fs::absolute(path).lexically_normal();
    for (const fs::path& file : event_companions(own, recorded.format, options_)) {
      annotation_files_.push_back(written_beside(file, own, recorded.path));
    }
    recorded.recording = open_recording(path, recorded.format, options_);
    const Recording& recording = *recorded.recording;
    for (std::int64_t i = 0; i < recording.frame_count(); ++i) {
      recorded.frame_times_s.push_back(recording.frame_time_s(i));
    }
    recorded.event_span = recording.event_span();
    if (reads_flow_) {
      recorded.flow = open_recording_flow(recorded.format, own, recording.size(), options_);
      if (!recorded.flow) return;
      for (const fs::path& file : recorded.flow->files) {
        annotation_files_.push_back(written_beside(file, own, recorded.path));
      }
    }
    if (recorded.frame_times_s.empty()) {
      open_without_frames(recorded);
      return;
    }
    const bool by_frames = !window_.duration_s && !window_.events && !recorded.flow;
    if (recorded.frame_times_s.size() < 2 && by_frames) {
      throw InputError(
          "expected two frames or more, or window_s or window_events, got one frame, "
          "in " +
          recorded.path);
    }
    recorded.span = {recorded.frame_times_s.front(), recorded.frame_times_s.back()};
    if (const auto& events = recorded.event_span) {
      recorded.span[0] = std::min(recorded.span[0], (*events)[0]);
      recorded.span[1] = std::max(recorded.span[1], (*events)[1]);
    }
  }

  /// The labels' time is where the window has it.
  void read_window(Recorded& recorded) {
    const auto [first_s, last_s] = recorded.span;
    const double time_s =
        window_.label == LabelPlace::kMiddle ? first_s + (last_s - first_s) / 2 : last_s;
    recorded.labels =
        window_labels_.read(recorded.label_file_on_disk, recorded.recording->size(), time_s);
  }

  void open_without_frames(Recorded& recorded) const {
    const bool is_labelled = !recorded.label_file.empty() || recorded.flow;
    const bool has_windows = recorded.is_window() || recorded.flow;
    if (!window_.duration_s && !(is_labelled && window_.events) && !has_windows) {
      throw InputError(
          fmt::format("expected window_s{}, since the recording has no frames, got {}, in {}",
                      is_labelled ? " or window_events" : ", or labels",
                      window_.events ? "window_events alone" : "neither", recorded.path));
    }
    // A still scene begins at 0, and nothing tells how long it lasts.
    recorded.span = recorded.event_span.value_or(std::array{0.0, 0.0});
    if (is_labelled) {
      constexpr double kEver = std::numeric_limits<double>::infinity();
      if (!recorded.event_span && !recorded.is_window()) recorded.span = {-kEver, kEver};
      return;
    }
    const double length_s = *window_.duration_s;
    const double begin_s = recorded.span[0] - kJustBefore_s;
    const double count = std::ceil((recorded.span[1] - begin_s) / length_s);
    constexpr double kMostWindows = 1e7;
    if (count > kMostWindows) {
      throw InputError(fmt::format(
          "expected events of at most {:.0f} windows, got times from {} s to {} s, in {}",
          kMostWindows, recorded.span[0], recorded.span[1], recorded.path));
    }
    recorded.windows = {begin_s, static_cast<std::int64_t>(count)};
    recorded.span[1] = begin_s + count * length_s;
  }

  /// Of Prophesee's boxes, which reach beyond the sensor, those that lie outside or have no size
  /// are left out; the others are cut where labels are mapped.
  void fit_boxes(Recorded& recorded) {
    if (recorded.label_file_on_disk.extension() != ".npy") return;
    const ImageSize size = recorded.recording->size();
    const double width = size.width, height = size.height;
    std::size_t cut = 0, left_out = 0;
    for (auto& [time_s, annotation] : recorded.labels.annotations) {
      std::erase_if(annotation.boxes, [&](const Box& box) {
        const auto& [left, top, right, bottom] = box.xyxy;
        const bool is_out = std::min(right, width) <= std::max(left, 0.0) ||
                            std::min(bottom, height) <= std::max(top, 0.0);
        const bool is_cut = left < 0 || top < 0 || right > width || bottom > height;
        left_out += is_out ? 1 : 0;
        cut += !is_out && is_cut ? 1 : 0;
        return is_out;
      });
    }
    if (cut + left_out == 0) return;
    cut_boxes_ += cut;
    left_out_boxes_ += left_out;
    files_of_fitted_boxes_.push_back(recorded.label_file);
  }

  /// Of all recordings.
  void tell_counts() {
    if (!files_of_fitted_boxes_.empty()) {
      notes_.push_back(
          counted(files_of_fitted_boxes_, "file",
                  fmt::format(" with boxes beyond the sensor: {} cut to it, {} left out since they "
                              "are outside or without a size (their times stay)",
                              cut_boxes_, left_out_boxes_)));
      if (left_out_boxes_ > 0) warnings_.push_back(notes_.back());
    }
    if (!without_events_.empty()) {
      notes_.push_back(counted(without_events_, "recording",
                               fmt::format(" without events ({} empty event volume{})",
                                           empty_volumes_, empty_volumes_ == 1 ? "" : "s")));
      warnings_.push_back(notes_.back());
    }
  }

  /// The classes of texts beside windows, as YOLO's names or numbers order them; none where these
  /// disagree, or some labels are others.
  std::optional<std::vector<std::string>> window_classes() const {
    std::vector<std::string> longest;
    for (const auto& [name, recorded] : recordings_) {
      if (!recorded.is_window()) return std::nullopt;
      const auto& names = recorded.labels.class_names;
      const auto [end, other] = std::ranges::mismatch(names, longest);
      if (end != names.end() && other != longest.end()) return std::nullopt;
      if (names.size() > longest.size()) longest = names;
    }
    return longest;
  }

  /// Numbers the classes of all recordings by their names' order, whatever the order of the files,
  /// unless window_classes tells it.
  void number_classes() {
    std::map<std::string, int> numbers;
    const std::vector<std::string>* joints = nullptr;
    for (const auto& [name, recorded] : recordings_) {
      for (const std::string& class_name : recorded.labels.class_names) numbers[class_name] = 0;
      if (recorded.label_file.empty() || recorded.labels.joint_names.empty()) continue;
      if (joints != nullptr && *joints != recorded.labels.joint_names) {
        throw InputError(
            "expected the same joint_names in all labels of a source, got others, in " +
            recorded.label_file);
      }
      joints = &recorded.labels.joint_names;
    }
    if (joints != nullptr) schema_.joint_names = *joints;
    schema_.class_names = window_classes().value_or(std::vector<std::string>());
    if (schema_.class_names.empty()) {
      for (const auto& [class_name, number] : numbers) schema_.class_names.push_back(class_name);
    }
    for (std::size_t i = 0; i < schema_.class_names.size(); ++i) {
      numbers[schema_.class_names[i]] = static_cast<int>(i);
    }
    for (auto& [name, recorded] : recordings_) {
      for (auto& [time_s, annotation] : recorded.labels.annotations) {
        for (Box& box : annotation.boxes) {
          box.class_id =
              numbers.at(recorded.labels.class_names[static_cast<std::size_t>(box.class_id)]);
        }
      }
    }
  }

  void list_times(const std::string& name, const Recorded& recorded) {
    const std::vector<double>& frames = recorded.frame_times_s;
    if (recorded.flow) {
      for (const Span& span : recorded.flow->times_s) list_time(name, recorded, span[0]);
      return;
    }
    if (recorded.label_file.empty()) {
      // The first frame ends no interval.
      const bool by_frames = !window_.duration_s && !window_.events;
      for (std::size_t i = by_frames ? 1 : 0; i < frames.size(); ++i) {
        list_time(name, recorded, frames[i]);
      }
      const double length_s = window_.duration_s.value_or(0);
      const double place = window_.label == LabelPlace::kMiddle ? 0.5 : 1;
      for (std::int64_t i = 0; i < recorded.windows.count; ++i) {
        list_time(name, recorded,
                  recorded.windows.begin_s + (static_cast<double>(i) + place) * length_s);
      }
      return;
    }
    for (const auto& [labelled_s, annotation] : recorded.labels.annotations) {
      const auto near = std::ranges::lower_bound(frames, labelled_s - kSameTime_s);
      const bool on_frame = near != frames.end() && *near <= labelled_s + kSameTime_s;
      list_time(name, recorded, on_frame ? *near : labelled_s);
    }
  }

  /// Whether there can be events of the window's time.
  bool meets_events(const Recorded& recorded, double time_s) const {
    if (!recorded.event_span) return false;
    const auto [first_s, last_s] = *recorded.event_span;
    const Span window = span_of(recorded, time_s).value_or(Span{time_s, time_s});
    return window[1] >= first_s && (window[0] < last_s || window[1] <= last_s);
  }

  /// A clock that began elsewhere makes sound samples of nothing: no single one can tell.
  void compare_clocks(const Recorded& recorded, std::span<const LabelledFrame> windows) {
    std::vector<double> all, outside;
    for (const LabelledFrame& window : windows) {
      if (!window.fault.empty() && !recorded.flow) continue;
      all.push_back(window.frame.time_s);
      if (!meets_events(recorded, all.back())) outside.push_back(all.back());
    }
    if (!recorded.event_span) {
      without_events_.push_back(recorded.path);
      empty_volumes_ += all.size();
      return;
    }
    if (recorded.flow) note_long_windows(recorded, all);
    if (outside.empty()) return;
    const bool is_all = outside.size() == all.size();
    const auto [first_s, last_s] = *recorded.event_span;
    notes_.push_back(fmt::format(
        "expected windows within the times of the events, {} s to {} s, got {} of {} outside "
        "them, at {} s to {} s{}, in {}",
        first_s, last_s, outside.size(), all.size(), std::ranges::min(outside),
        std::ranges::max(outside), is_all ? " (are events, frames and labels on one clock?)" : "",
        recorded.path));
    if (is_all) warnings_.push_back(notes_.back());
  }

  /// A window of flow that reaches beyond the events has fewer of them than its flow says.
  void note_long_windows(const Recorded& recorded, const std::vector<double>& times_s) {
    constexpr double kMostBeyond = 0.01;  // of its length
    const Span events = *recorded.event_span;
    const auto is_long = [&](double time_s) {
      const Span window = *span_of(recorded, time_s);
      const double within_s = std::min(window[1], events[1]) - std::max(window[0], events[0]);
      return within_s < (1 - kMostBeyond) * (window[1] - window[0]);
    };
    const auto count = std::ranges::count_if(times_s, is_long);
    if (count == 0) return;
    notes_.push_back(
        count_text(count, "window",
                   fmt::format(" of flow beyond the events, which last from {} s to {} s, in {}",
                               events[0], events[1], recorded.path)));
  }

  /// Times within two microseconds of each other are one sample, which is at fault: none of them
  /// tells what is there.
  void list_time(const std::string& name, const Recorded& recorded, double time_s) {
    const double before_s = std::exchange(listed_s_, time_s);
    if (!labelled_.empty() && labelled_.back().sequence == name &&
        time_s - before_s <= 2 * kSameTime_s) {
      LabelledFrame& first = labelled_.back();
      first.fault = fmt::format(
          "expected times more than two microseconds apart, got {} s and another, in {} ({})",
          first.frame.time_s, label_place(first.label_key), first.sample_id);
      return;
    }
    LabelledFrame frame;
    frame.sample_id = fmt::format("{}/{:017.6f}", name, time_s);
    frame.sequence = name;
    frame.frame = recorded.ref(time_s);
    frame.label_key = fmt::format("{}/{}", name, time_s);  // exactly, as short as can be
    // Without frames nothing tells how long it lasts behind its last event: a window may end there.
    const bool is_late = time_s > recorded.span[1] &&
                         (!recorded.frame_times_s.empty() || !meets_events(recorded, time_s));
    const bool is_outside = time_s < recorded.span[0] || is_late;
    if (recorded.flow) {
      if (recorded.event_span && !meets_events(recorded, time_s)) {
        frame.fault = fmt::format(
            "expected a window among the events, from {} s to {} s, got one from {} s, in {} ({})",
            (*recorded.event_span)[0], (*recorded.event_span)[1], time_s,
            label_place(frame.label_key), frame.sample_id);
      }
    } else if (is_outside) {
      frame.fault = fmt::format(
          "expected a time between {} s and {} s, which the recording lasts, got {} s, in {} ({})",
          recorded.span[0], recorded.span[1], time_s, label_place(frame.label_key),
          frame.sample_id);
    }
    labelled_.push_back(std::move(frame));
  }

  WindowSpec window_;
  RecordingOptions options_;
  bool reads_flow_;
  WindowLabels window_labels_;
  std::map<std::string, Recorded> recordings_;  ///< by name
  LabelSchema schema_;
  std::vector<LabelledFrame> labelled_;
  double listed_s_ = 0;  ///< the time of the last one
  std::size_t cut_boxes_ = 0, left_out_boxes_ = 0, empty_volumes_ = 0;
  std::vector<std::string> files_of_fitted_boxes_, without_events_;  ///< as FrameRef::path
  std::vector<std::string> annotation_files_;  ///< as FrameRef::path is written
  std::vector<std::string> notes_;
  std::vector<std::string> warnings_;
  std::vector<std::string> unreadable_;          ///< Dataset::unreadable
  std::map<std::string, std::string> unopened_;  ///< why recordings do not open, by name
};

}  // namespace

std::unique_ptr<Dataset> open_recording_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<RecordingDataset>(spec, base);
}

}  // namespace eventgan
