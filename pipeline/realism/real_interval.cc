#include "pipeline/realism/real_interval.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "manifests/values/faults.h"
#include "stages/events/event_volume.h"
#include "stages/events/volume_statistics.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

/// Bilinear; NaN outside the pixels' centres, and where a neighbour that counts is NaN.
float value_at(const std::vector<float>& values, ImageSize size, float x, float y) {
  const auto right = static_cast<float>(size.width - 1);
  const auto bottom = static_cast<float>(size.height - 1);
  if (!(x >= 0 && y >= 0 && x <= right && y <= bottom)) return kUnknown;
  const int x0 = std::clamp(static_cast<int>(x), 0, std::max(size.width - 2, 0));
  const int y0 = std::clamp(static_cast<int>(y), 0, std::max(size.height - 2, 0));
  const float along_x = x - static_cast<float>(x0);
  const float along_y = y - static_cast<float>(y0);
  float sum = 0;
  for (const int dy : {0, 1}) {
    for (const int dx : {0, 1}) {
      const float weight = (dx == 0 ? 1 - along_x : along_x) * (dy == 0 ? 1 - along_y : along_y);
      // NaN times zero is NaN; and an image of one row or column has no neighbour there.
      if (weight == 0) continue;
      sum +=
          weight * values[static_cast<std::size_t>(y0 + dy) * static_cast<std::size_t>(size.width) +
                          static_cast<std::size_t>(x0 + dx)];
    }
  }
  return sum;
}

/// Carries every pixel's displacement on by one frame interval.
void follow(FlowField& path, const FlowField& step) {
  for (int y = 0; y < path.size.height; ++y) {
    for (int x = 0; x < path.size.width; ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(path.size.width) +
                      static_cast<std::size_t>(x);
      const float now_x = static_cast<float>(x) + path.x_px[at];
      const float now_y = static_cast<float>(y) + path.y_px[at];
      path.x_px[at] += value_at(step.x_px, step.size, now_x, now_y);
      path.y_px[at] += value_at(step.y_px, step.size, now_x, now_y);
    }
  }
}

}  // namespace

std::optional<FlowField> flow_path(const Recording& recording, const FrameInterval& interval) {
  std::optional<FlowField> path = recording.flow(interval.first);
  for (std::int64_t frame = interval.first + 1; path && frame < interval.last; ++frame) {
    const std::optional<FlowField> step = recording.flow(frame);
    if (!step) return std::nullopt;
    follow(*path, *step);
  }
  return path;
}

IntervalFrames frames_of(const Recording& recording, const FrameInterval& interval,
                         const std::vector<Event>& events) {
  return {interval,
          recording.frame_time_s(interval.last) - recording.frame_time_s(interval.first),
          recording.frame(interval.first),
          recording.frame(interval.last),
          std::ssize(events),
          std::ranges::count(events, true, &Event::positive)};
}

namespace {

void check_range(const Recording& recording, std::int64_t first, std::int64_t last) {
  if (first < 0 || last >= recording.frame_count() || first > last) {
    throw UsageError(
        "--frames: expected FIRST:LAST in 0.." + std::to_string(recording.frame_count() - 1) +
        ", got " + std::to_string(first) + ":" + std::to_string(last) + ", in " + recording.name());
  }
}

void check_gaps(const std::vector<int>& gaps) {
  const std::set<int> distinct(gaps.begin(), gaps.end());
  if (gaps.empty() || *distinct.begin() < 1 || distinct.size() != gaps.size()) {
    throw UsageError(
        fmt::format("--gaps: expected different numbers of frames, 1 or more, got \"{}\"",
                    fmt::join(gaps, ",")));
  }
}

}  // namespace

std::vector<FrameInterval> choose_intervals(const Recording& recording, std::int64_t first,
                                            std::optional<std::int64_t> last,
                                            const std::vector<int>& gaps) {
  if (recording.frame_count() == 0) {
    throw InputError("expected a recording with frames, got one without, in " + recording.name());
  }
  const std::int64_t end = last.value_or(recording.frame_count() - 1);
  check_range(recording, first, end);
  check_gaps(gaps);
  std::vector<FrameInterval> intervals;
  for (const int gap : gaps) {
    for (std::int64_t i = first; i + gap <= end; ++i) intervals.push_back({i, i + gap});
  }
  if (intervals.empty()) {
    throw UsageError("expected frames " + std::to_string(*std::ranges::min_element(gaps)) +
                     " apart, got frames " + std::to_string(first) + ":" + std::to_string(end) +
                     ", in " + recording.name());
  }
  return intervals;
}

std::vector<float> network_input(const IntervalFrames& frames) {
  const std::size_t first = frames.previous.pixels.size();
  std::vector<float> input(first + frames.next.pixels.size());
  to_input(frames.previous.pixels, std::span(input).first(first));
  to_input(frames.next.pixels, std::span(input).subspan(first));
  return input;
}

IntervalFrames read_frames(const Recording& recording, const FrameInterval& interval) {
  return frames_of(recording, interval, recording.events_between(interval.first, interval.last));
}

RealInterval read_interval(const Recording& recording, const FrameInterval& interval, int bins) {
  const std::vector<Event> events = recording.events_between(interval.first, interval.last);
  return {frames_of(recording, interval, events),
          normalized(event_volume(events, {bins, recording.size()})),
          flow_path(recording, interval)};
}

}  // namespace eventgan
