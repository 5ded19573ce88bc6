#include "stages/frames/events/windowed_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// An event at a window's begin is not in it, and none at whole microseconds lies on the border of
/// two windows that begin so long before one.
constexpr double kJustBefore_s = kSameTime_s / 4;

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

}  // namespace

void WindowedRecording::open(const fs::path& base, const RecordingOptions& options,
                             bool reads_flow) {
  const fs::path on_disk = base / path;
  const fs::path own = fs::absolute(on_disk).lexically_normal();
  for (const fs::path& file : event_companions(own, format, options)) {
    beside.push_back(written_beside(file, own, path));
  }
  recording = open_recording(on_disk, format, options);
  for (std::int64_t i = 0; i < recording->frame_count(); ++i) {
    frame_times_s.push_back(recording->frame_time_s(i));
  }
  event_span = recording->event_span();
  if (reads_flow) {
    flow = open_recording_flow(format, own, recording->size(), options);
    if (!flow) return;
    for (const fs::path& file : flow->files) beside.push_back(written_beside(file, own, path));
  }
  if (frame_times_s.empty()) {
    open_without_frames();
    return;
  }
  if (frame_times_s.size() < 2 && is_by_frames() && !flow) {
    throw InputError(
        "expected two frames or more, or window_s or window_events, got one frame, "
        "in " +
        path);
  }
  span = {frame_times_s.front(), frame_times_s.back()};
  if (event_span) {
    span[0] = std::min(span[0], (*event_span)[0]);
    span[1] = std::max(span[1], (*event_span)[1]);
  }
}

void WindowedRecording::open_without_frames() {
  const bool is_labelled = !label_file.empty() || flow;
  const bool has_windows = is_window() || flow;
  if (!window.duration_s && !(is_labelled && window.events) && !has_windows) {
    throw InputError(
        fmt::format("expected window_s{}, since the recording has no frames, got {}, in {}",
                    is_labelled ? " or window_events" : ", or labels",
                    window.events ? "window_events alone" : "neither", path));
  }
  // A still scene begins at 0, and nothing tells how long it lasts.
  span = event_span.value_or(Span{0, 0});
  if (is_labelled) {
    constexpr double kEver = std::numeric_limits<double>::infinity();
    if (!event_span && !is_window()) span = {-kEver, kEver};
    return;
  }
  const double length_s = *window.duration_s;
  first_begin_s_ = span[0] - kJustBefore_s;
  const double count = std::ceil((span[1] - first_begin_s_) / length_s);
  constexpr double kMostWindows = 1e7;
  if (count > kMostWindows) {
    throw InputError(
        fmt::format("expected events of at most {:.0f} windows, got times from {} s to {} s, in {}",
                    kMostWindows, span[0], span[1], path));
  }
  window_count_ = static_cast<std::int64_t>(count);
  span[1] = first_begin_s_ + count * length_s;
}

FrameRef WindowedRecording::ref(double time_s) const {
  const std::int64_t frame =
      std::ranges::upper_bound(frame_times_s, time_s) - frame_times_s.begin() - 1;
  return {path, frame, frame, time_s};
}

std::vector<double> WindowedRecording::times_s() const {
  std::vector<double> times_s;
  if (flow) {
    for (const Span& map : flow->times_s) times_s.push_back(map[0]);
    return times_s;
  }
  if (label_file.empty()) {
    // The first frame ends no interval.
    for (std::size_t i = is_by_frames() ? 1 : 0; i < frame_times_s.size(); ++i) {
      times_s.push_back(frame_times_s[i]);
    }
    const double length_s = window.duration_s.value_or(0);
    const double place = window.label == LabelPlace::kMiddle ? 0.5 : 1;
    for (std::int64_t i = 0; i < window_count_; ++i) {
      times_s.push_back(first_begin_s_ + (static_cast<double>(i) + place) * length_s);
    }
    return times_s;
  }
  for (const auto& [labelled_s, annotation] : labels.annotations) {
    const auto near = std::ranges::lower_bound(frame_times_s, labelled_s - kSameTime_s);
    const bool on_frame = near != frame_times_s.end() && *near <= labelled_s + kSameTime_s;
    times_s.push_back(on_frame ? *near : labelled_s);
  }
  return times_s;
}

std::optional<Span> WindowedRecording::window_at(double time_s) const {
  if (flow) {
    const std::optional<std::size_t> map = flow->map_from(time_s, kSameTime_s);
    return map ? flow->times_s[*map] : Span{time_s, time_s};
  }
  if (window.events) return std::nullopt;
  if (!window.duration_s && is_window()) return Span{span[0] - kJustBefore_s, span[1]};
  if (!window.duration_s) return frame_window(frame_times_s, time_s, window.label);
  const bool is_middle = window.label == LabelPlace::kMiddle;
  const double length_s = *window.duration_s;
  if (window_count_ > 0) {
    // From the window's number, so that one's end is the next one's begin to the last bit: no
    // event falls between two.
    const double i = std::round((time_s - first_begin_s_) / length_s - (is_middle ? 0.5 : 1));
    return Span{first_begin_s_ + i * length_s, first_begin_s_ + (i + 1) * length_s};
  }
  const double after_s = is_middle ? length_s / 2 : 0;
  return Span{later(time_s, after_s - length_s), later(time_s, after_s)};
}

bool WindowedRecording::meets_events(double time_s) const {
  if (!event_span) return false;
  const auto [first_s, last_s] = *event_span;
  const Span at = window_at(time_s).value_or(Span{time_s, time_s});
  return at[1] >= first_s && (at[0] < last_s || at[1] <= last_s);
}

}  // namespace eventgan
