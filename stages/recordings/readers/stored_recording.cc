#include "stages/recordings/readers/detail/stored_recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <iterator>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/recordings/readers/detail/frame_intervals.h"

namespace eventgan {

std::vector<double> EventStore::times_s(std::int64_t first, std::int64_t count) const {
  const std::vector<StoredEvent> events = read(first, count);
  std::vector<double> times(events.size());
  std::ranges::transform(events, times.begin(), &StoredEvent::t_s);
  return times;
}

namespace {

constexpr std::int64_t kEventsPerRead = std::int64_t{1} << 17;

}  // namespace

TimeOrder EventStore::order() const {
  TimeOrder order(kMostLift_s);
  for (std::int64_t first = 0; first < count(); first += kEventsPerRead) {
    const std::int64_t events = std::min(kEventsPerRead, count() - first);
    try {
      order.add_all(times_s(first, events), first);
    } catch (const InputError&) {
      order.add_unreadable(std::current_exception());
      order.end_block(first + events);
    }
  }
  return order;
}

ImageSize sensor_size(const std::optional<ImageSize>& told, const std::optional<ImageSize>& given,
                      StoredParts& parts) {
  if (!told && !given) {
    throw InputError(
        "expected the sensor's size in the file, or \"sensor\": {\"width\": ..., \"height\": ...} "
        "in "
        "the manifest, got none, in " +
        parts.name);
  }
  if (told && given && *told != *given) {
    parts.warnings.push_back(fmt::format(
        "the file tells a sensor of {}, the manifest's \"sensor\" is {}, which counts, in {}",
        to_string(*told), to_string(*given), parts.name));
  }
  return given ? *given : *told;
}

namespace {

class StoredRecording final : public Recording {
 public:
  explicit StoredRecording(StoredParts parts)
      : parts_(std::move(parts)),
        event_count_(parts_.events->count()),
        frame_times_s_(parts_.frames ? parts_.frames->times_s() : std::vector<double>()) {
    if (parts_.frames) check_frame_times(frame_times_s_, parts_.name);
  }

  const std::string& name() const override { return parts_.name; }
  ImageSize size() const override { return parts_.size; }
  std::int64_t frame_count() const override { return std::ssize(frame_times_s_); }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = parts_.notes;
    if (parts_.frames) std::ranges::move(parts_.frames->notes(), std::back_inserter(notes));
    if (const std::int64_t lifted = lifted_) {
      notes.push_back(fmt::format(
          "times step back by less than two milliseconds: {} {} lifted to the latest before, in {}",
          lifted, lifted == 1 ? "is" : "are", name()));
    }
    return notes;
  }

  std::vector<std::string> warnings() const override { return parts_.warnings; }

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
    if (first == last) return {};
    return events_in(frame_times_s_[first], frame_times_s_[last]);
  }

  std::vector<Event> events_in(double after_s, double until_s) const override {
    require_order(after_s, until_s);
    return read_events(events_until(after_s), events_until(until_s),
                       EventCheck(size(), after_s, until_s));
  }

  std::vector<Event> events_around(double time_s, std::int64_t before,
                                   std::int64_t after) const override {
    require_order(time_s, time_s);
    const std::int64_t middle = events_until(time_s);
    const std::int64_t begin = std::max<std::int64_t>(middle - before, 0);
    const std::int64_t end = middle + std::min(after, event_count_ - middle);
    if (begin < end) {  // events of these times may lie elsewhere
      const auto first_s = parts_.events->times_s(begin, 1)[0];
      const auto last_s = parts_.events->times_s(end - 1, 1)[0];
      require_order(std::min(first_s, time_s), std::max(last_s, time_s));
    }
    return read_events(begin, end, EventCheck::of_any_time(size()));
  }

  std::optional<std::array<double, 2>> event_span() const override {
    if (event_count_ == 0) return std::nullopt;
    for (const std::int64_t event : {std::int64_t{0}, event_count_ - 1}) {
      const double time_s = parts_.events->times_s(event, 1)[0];
      try {
        check_event_time(time_s, time_s);
      } catch (const EventFault& fault) {
        refuse(fault, event);
      }
    }
    return order().span();
  }

 private:
  const TimeOrder& order() const {
    std::call_once(order_once_, [&] {
      order_ = known_order(parts_.index_key, event_count_, [&] { return parts_.events->order(); });
      lifted_ = order_.lifted();
    });
    return order_;
  }

  void require_order(double after_s, double until_s) const {
    eventgan::require_order(
        order(), after_s, until_s,
        [&](const EventFault& fault, std::int64_t event) { refuse(fault, event); });
  }

  /// How many events are at or before a time, at which no time falls.
  std::int64_t events_until(double time_s) const {
    const auto [begin, end] = order().block_after(time_s);
    const std::vector<double> times = parts_.events->times_s(begin, end - begin);
    const auto later =
        std::ranges::find_if(times, [&](double t_s) { return std::isfinite(t_s) && t_s > time_s; });
    return begin + (later - times.begin());
  }

  /// The latest time of the events before one.
  double latest_before(std::int64_t event) const {
    auto [first, latest_s] = order().blocks_until(event);
    for (const double time_s : parts_.events->times_s(first, event - first)) {
      if (std::isfinite(time_s)) latest_s = std::max(latest_s, time_s);
    }
    return latest_s;
  }

  std::vector<Event> read_events(std::int64_t begin, std::int64_t end, EventCheck check) const {
    std::optional<double> latest_s;  // none: no time is lifted
    if (order().lifted() > 0) latest_s = latest_before(begin);
    std::vector<Event> events;
    events.reserve(static_cast<std::size_t>(std::max<std::int64_t>(end - begin, 0)));
    std::int64_t next = begin;
    try {
      while (next < end) {
        for (StoredEvent stored : parts_.events->read(next, std::min(kEventsPerRead, end - next))) {
          if (latest_s) {
            const bool is_lifted = stored.t_s < *latest_s && stored.t_s > *latest_s - kMostLift_s;
            latest_s = stored.t_s = is_lifted ? *latest_s : stored.t_s;
          }
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
  mutable std::once_flag order_once_;
  mutable TimeOrder order_;
  mutable std::atomic<std::int64_t> lifted_ = 0;  ///< once the order is known
};

}  // namespace

std::unique_ptr<Recording> make_stored_recording(StoredParts parts) {
  return std::make_unique<StoredRecording>(std::move(parts));
}

}  // namespace eventgan
