#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/events/recording_flow.h"
#include "stages/frames/events/recording_folder.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

inline constexpr double kSameTime_s = 1e-6;  ///< what labels written with six decimals can lose

/// A recording of a source, and where its windows are (open_recording_dataset has the rules).
///
/// Thread safety: once it is open, its const members may be called from several threads.
struct WindowedRecording : FoundFile {
  WindowSpec window;
  std::unique_ptr<Recording> recording;
  std::vector<double> frame_times_s;
  Span span{};                        ///< first and last time of a frame, an event or a window
  std::optional<Span> event_span;     ///< first and last time of an event; none: there are none
  RecordingLabels labels;             ///< whoever reads them sets them
  std::optional<RecordingFlow> flow;  ///< whose times are its windows
  std::vector<std::string> beside;    ///< files that open() has read, too, written as `path` is

  WindowedRecording(FoundFile file, const WindowSpec& of)
      : FoundFile(std::move(file)), window(of) {}

  /// Whether it is one window, whose labels have no time.
  bool is_window() const { return is_window_label_file(label_file); }

  /// `path` starts from `base`; `label_file` is known before. With `reads_flow` also the flow
  /// beside it; if there is none, `flow` stays empty and nothing is said of windows. Throws
  /// InputError if it or the flow does not open, if nothing tells where its windows end, or if
  /// there are more than 10 million; `beside` is kept then.
  void open(const std::filesystem::path& base, const RecordingOptions& options, bool reads_flow);

  /// The last frame at or before the time; number -1 if there is none.
  FrameRef ref(double time_s) const;

  /// The times of its windows: of its flow, of its labels (of a frame's, if they mean one), else of
  /// its frames and of windows of one length, one behind the other.
  std::vector<double> times_s() const;

  /// The window of one of these times; none where so many events make it, whatever their times.
  std::optional<Span> window_at(double time_s) const;

  /// Whether there can be events of the window's time.
  bool meets_events(double time_s) const;

 private:
  bool is_by_frames() const { return !window.duration_s && !window.events; }
  void open_without_frames();

  double first_begin_s_ = 0;       ///< of windows one behind the other,
  std::int64_t window_count_ = 0;  ///< so many
};

}  // namespace eventgan
