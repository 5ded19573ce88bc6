#include "stages/frames/events/recording_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
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
#include "stages/frames/events/recording_folder.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/events/windowed_recording.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class RecordingDataset final : public Dataset {
 public:
  RecordingDataset(const SourceSpec& spec, const fs::path& base)
      : window_(spec.window), options_(spec.recording), reads_flow_(spec.flow) {
    RecordingFolder found = look_into_recordings(spec, base);
    notes_ = std::move(found.notes);
    unreadable_ = std::move(found.unreadable);
    unopened_ = std::move(found.unopened);
    for (auto& [name, file] : found.recordings) {
      recordings_.emplace(name, WindowedRecording(std::move(file), window_));
    }
    read_labels();
    open_all(base, spec.root);
    number_classes();
    for (const auto& [name, recorded] : recordings_) {
      const std::size_t first = labelled_.size();
      for (const double time_s : recorded.times_s()) list_time(name, recorded, time_s);
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
    const WindowedRecording& recorded = recordings_.at(labelled.sequence);
    FrameRef edge = labelled.frame;
    if (const std::optional<Span> span = recorded.window_at(labelled.frame.time_s)) {
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
    if (const std::optional<Span> span = recorded.window_at(time_s)) {
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
  std::pair<const WindowedRecording&, double> find(const std::string& label_key) const {
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
        entry->second.open(base, options_, reads_flow_);
      } catch (const InputError& error) {
        if (is_one) throw;
        keep_files(entry->second);
        if (!first) first = std::current_exception();
        unreadable_.emplace_back(error.what());
        unopened_[entry->first] = error.what();
        entry = recordings_.erase(entry);
        continue;
      }
      keep_files(entry->second);
      if (reads_flow_ && !entry->second.flow) {
        without_flow.push_back(entry->first);
        entry = recordings_.erase(entry);
        continue;
      }
      if (entry->second.flow && entry->second.flow->is_of_unknown_view) {
        of_unknown_view_.push_back(entry->second.path);
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

  void keep_files(const WindowedRecording& recorded) {
    annotation_files_.insert(annotation_files_.end(), recorded.beside.begin(),
                             recorded.beside.end());
  }

  /// The labels' time is where the window has it.
  void read_window(WindowedRecording& recorded) {
    const auto [first_s, last_s] = recorded.span;
    const double time_s =
        window_.label == LabelPlace::kMiddle ? first_s + (last_s - first_s) / 2 : last_s;
    recorded.labels =
        window_labels_.read(recorded.label_file_on_disk, recorded.recording->size(), time_s);
  }

  /// Of Prophesee's boxes, which reach beyond the sensor, those that lie outside or have no size
  /// are left out; the others are cut where labels are mapped.
  void fit_boxes(WindowedRecording& recorded) {
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
    if (!of_unknown_view_.empty()) {
      notes_.push_back(
          counted(of_unknown_view_, "recording",
                  " of DSEC with flow of the rectified view but no rectify_map.h5: flow "
                  "is wrong unless the events are rectified, too"));
      warnings_.push_back(notes_.back());
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

  /// A clock that began elsewhere makes sound samples of nothing: no single one can tell.
  void compare_clocks(const WindowedRecording& recorded, std::span<const LabelledFrame> windows) {
    std::vector<double> all, outside;
    for (const LabelledFrame& window : windows) {
      if (!window.fault.empty() && !recorded.flow) continue;
      all.push_back(window.frame.time_s);
      if (!recorded.meets_events(all.back())) outside.push_back(all.back());
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
  void note_long_windows(const WindowedRecording& recorded, const std::vector<double>& times_s) {
    constexpr double kMostBeyond = 0.01;  // of its length
    const Span events = *recorded.event_span;
    const auto is_long = [&](double time_s) {
      const Span window = *recorded.window_at(time_s);
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
  void list_time(const std::string& name, const WindowedRecording& recorded, double time_s) {
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
                         (!recorded.frame_times_s.empty() || !recorded.meets_events(time_s));
    const bool is_outside = time_s < recorded.span[0] || is_late;
    if (recorded.flow) {
      if (recorded.event_span && !recorded.meets_events(time_s)) {
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
  std::map<std::string, WindowedRecording> recordings_;  ///< by name
  LabelSchema schema_;
  std::vector<LabelledFrame> labelled_;
  double listed_s_ = 0;  ///< the time of the last one
  std::size_t cut_boxes_ = 0, left_out_boxes_ = 0, empty_volumes_ = 0;
  std::vector<std::string> files_of_fitted_boxes_, without_events_,
      of_unknown_view_;                        ///< as FrameRef::path
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
