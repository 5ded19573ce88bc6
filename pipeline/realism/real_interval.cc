#include "pipeline/realism/real_interval.h"

#include <algorithm>
#include <set>
#include <string>

#include "manifests/faults.h"
#include "pipeline/realism/flow_path.h"
#include "stages/events/event_volume.h"
#include "stages/events/normalization.h"

namespace eventgan {
namespace {

IntervalFrames frames_of(const Recording& recording, const FrameInterval& interval,
                         std::size_t event_count) {
  return {interval, recording.frame_time_s(interval.last) - recording.frame_time_s(interval.first),
          recording.frame(interval.first), recording.frame(interval.last),
          static_cast<std::int64_t>(event_count)};
}

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
    std::string list;
    for (const int gap : gaps) list += (list.empty() ? "" : ",") + std::to_string(gap);
    throw UsageError("--gaps: expected different numbers of frames, 1 or more, got \"" + list +
                     "\"");
  }
}

}  // namespace

std::vector<FrameInterval> choose_intervals(const Recording& recording, std::int64_t first,
                                            std::optional<std::int64_t> last,
                                            const std::vector<int>& gaps) {
  if (recording.frame_count() == 0) {
    throw InputError("expected frames, got none, in " + recording.name());
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
  std::vector<float> input;
  input.reserve(frames.previous.pixels.size() + frames.next.pixels.size());
  for (const GreyImage* frame : {&frames.previous, &frames.next}) {
    for (const std::uint8_t value : frame->pixels) {
      input.push_back((static_cast<float>(value) / 255.0f - 0.5f) * 2.0f);
    }
  }
  return input;
}

IntervalFrames read_frames(const Recording& recording, const FrameInterval& interval) {
  return frames_of(recording, interval,
                   recording.events_between(interval.first, interval.last).size());
}

RealInterval read_interval(const Recording& recording, const FrameInterval& interval, int bins) {
  const std::vector<Event> events = recording.events_between(interval.first, interval.last);
  return {frames_of(recording, interval, events.size()),
          normalized(event_volume(events, {bins, recording.size()})),
          flow_path(recording, interval)};
}

}  // namespace eventgan
