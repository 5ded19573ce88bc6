#include "stages/recordings/detail/stored_recording.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <string>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/recordings/detail/frame_intervals.h"

namespace eventgan {

std::vector<double> EventStore::times_s(std::int64_t first, std::int64_t count) const {
  const std::vector<StoredEvent> events = read(first, count);
  std::vector<double> times(events.size());
  std::ranges::transform(events, times.begin(), &StoredEvent::t_s);
  return times;
}

namespace {

constexpr std::int64_t kEventsPerRead = std::int64_t{1} << 17;

class StoredRecording final : public Recording {
 public:
  explicit StoredRecording(StoredParts parts)
      : parts_(std::move(parts)),
        event_count_(parts_.events->count()),
        frame_times_s_(parts_.frames ? parts_.frames->times_s() : std::vector<double>()),
        boundaries_(frame_times_s_.size()) {
    if (parts_.frames) check_frame_times(frame_times_s_, parts_.name);
  }

  const std::string& name() const override { return parts_.name; }
  ImageSize size() const override { return parts_.size; }
  std::int64_t frame_count() const override { return std::ssize(frame_times_s_); }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = parts_.notes;
    if (parts_.frames) std::ranges::move(parts_.frames->notes(), std::back_inserter(notes));
    return notes;
  }

  double frame_time_s(std::int64_t index) const override {
    return frame_times_s_[frame_position(index, frame_count(), name())];
  }

  GreyImage frame(std::int64_t index) const override {
    frame_position(index, frame_count(), name());
    return parts_.frames->read(index);
  }

  std::optional<FlowField> flow(std::int64_t index) const override {
    frame_position(index, frame_count() - 1, name());
    return parts_.frames->flow(index);
  }

  std::vector<Event> events_between(std::int64_t first_frame,
                                    std::int64_t last_frame) const override {
    const auto [first, last] = frame_range(first_frame, last_frame, frame_count(), name());
    return read_events(events_until(first), events_until(last),
                       EventCheck(size(), frame_times_s_[first], frame_times_s_[last]));
  }

  std::vector<Event> events_in(double after_s, double until_s) const override {
    return read_events(events_until_time(after_s), events_until_time(until_s),
                       EventCheck(size(), after_s, until_s));
  }

  std::vector<Event> events_around(double time_s, std::int64_t before,
                                   std::int64_t after) const override {
    const std::int64_t middle = events_until_time(time_s);
    return read_events(std::max<std::int64_t>(middle - before, 0),
                       middle + std::min(after, event_count_ - middle),
                       EventCheck::of_any_time(size()));
  }

  std::optional<std::array<double, 2>> event_span() const override {
    if (event_count_ == 0) return std::nullopt;
    return std::array{event_times(0, 1)[0], event_times(event_count_ - 1, 1)[0]};
  }

 private:
  std::int64_t events_until(std::size_t frame) const {
    return boundaries_.at(frame, [&] {
      const std::vector<std::int64_t>& index = parts_.event_index;
      const double time_s = frame_times_s_[frame];
      return search(time_s, index.empty() ? parts_.events->near(time_s).value_or(event_count_ / 2)
                                          : index[frame]);
    });
  }

  /// Unless the events tell, the frame before tells where to look first.
  std::int64_t events_until_time(double time_s) const {
    if (const auto near = parts_.events->near(time_s)) return search(time_s, *near);
    if (frame_times_s_.empty()) return search(time_s, event_count_ / 2);
    const auto next = std::ranges::upper_bound(frame_times_s_, time_s);
    if (next == frame_times_s_.begin()) return search(time_s, 0);
    return search(time_s,
                  events_until(static_cast<std::size_t>(next - frame_times_s_.begin()) - 1));
  }

  std::int64_t search(double time_s, std::int64_t guess) const {
    return count_events_until(
        time_s, guess, event_count_,
        [&](std::int64_t begin, std::int64_t count) { return event_times(begin, count); });
  }

  std::vector<double> event_times(std::int64_t first, std::int64_t count) const {
    std::vector<double> times = parts_.events->times_s(first, count);
    // Among times out of order a search would find a wrong place and nobody would know.
    std::size_t at = 0;
    try {
      for (; at < times.size(); ++at) check_event_time(times[at == 0 ? 0 : at - 1], times[at]);
    } catch (const EventFault& fault) {
      refuse(fault, first + static_cast<std::int64_t>(at));
    }
    return times;
  }

  std::vector<Event> read_events(std::int64_t begin, std::int64_t end, EventCheck check) const {
    if (end < begin) {
      throw InputError("expected times that never decrease, got others, in " + name() +
                       " (events " + std::to_string(end) + ".." + std::to_string(begin) + ")");
    }
    std::vector<Event> events;
    events.reserve(static_cast<std::size_t>(end - begin));
    std::int64_t next = begin;
    try {
      while (next < end) {
        for (const StoredEvent& stored :
             parts_.events->read(next, std::min(kEventsPerRead, end - next))) {
          Event event = check.take(stored);
          if (!parts_.move || parts_.move(event)) events.push_back(event);
          ++next;
        }
      }
    } catch (const EventFault& fault) {
      refuse(fault, next);
    }
    return events;
  }

  [[noreturn]] void refuse(const EventFault& fault, std::int64_t event) const {
    throw InputError(std::string(fault.what()) + ", in " + name() + " (event " +
                     std::to_string(event) + ")");
  }

  StoredParts parts_;
  std::int64_t event_count_;
  std::vector<double> frame_times_s_;
  EventBoundaries boundaries_;
};

}  // namespace

std::unique_ptr<Recording> make_stored_recording(StoredParts parts) {
  return std::make_unique<StoredRecording>(std::move(parts));
}

}  // namespace eventgan
