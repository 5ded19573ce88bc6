#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/recently_used.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {

/// Events in their order, in 13 bytes each. What does not fit into whole numbers, and so is no
/// event, is kept beside them as it is.
class CompactEvents {
 public:
  void reserve(std::size_t count);
  void push_back(const StoredEvent& event);
  void divide_times(double divisor);

  std::int64_t size() const { return std::ssize(t_s_); }
  StoredEvent operator[](std::int64_t place) const;
  const std::vector<double>& times_s() const { return t_s_; }

 private:
  std::vector<double> t_s_;
  std::vector<std::int16_t> x_, y_;
  std::vector<std::int8_t> polarity_;
  std::map<std::int64_t, StoredEvent> others_;  ///< by their places
};

class EventParts;

/// Parts of files by their numbers; each weighs as many as it has events.
class RecentEvents : public RecentlyUsed<std::pair<const EventParts*, std::size_t>,
                                         std::shared_ptr<const CompactEvents>> {
 public:
  explicit RecentEvents(std::int64_t most)
      : RecentlyUsed(most, [](const auto& events) { return events->size(); }) {}
};

/// The events that were read last, of the whole process: sixteen million, or 220 MB.
RecentEvents& recent_events();

/// The events of a file that is read in parts: a table as a whole, the packets of AEDAT4. A part is
/// read when one of its events is first asked for, and then as long as recent_events() keeps it,
/// not again.
class EventParts : public EventStore {
 public:
  ~EventParts() override {
    recent_.forget({this, 0}, {this, std::numeric_limits<std::size_t>::max()});
  }

  std::int64_t count() const final { return count_; }
  std::vector<StoredEvent> read(std::int64_t first, std::int64_t count) const final;
  std::vector<double> times_s(std::int64_t first, std::int64_t count) const final;

  /// Known since it was opened.
  TimeOrder order() const final { return order_; }

 protected:
  /// `name` is for messages, `most_lift_s` as TimeOrder's.
  explicit EventParts(std::string name, RecentEvents& recent = recent_events(),
                      double most_lift_s = 0)
      : name_(std::move(name)), recent_(recent), order_(most_lift_s) {}

  /// While it is opened: the next part, which has events of times from `begin_s` to `end_s`.
  void add_part(std::int64_t count, double begin_s, double end_s);
  /// The same, of what has been read already; nothing if it is empty.
  void add_part(CompactEvents events);

  /// What lies between the parts added before and the next one is unknown.
  void add_unreadable(std::exception_ptr error) { order_.add_unreadable(std::move(error)); }

  /// What the parts added so far, none of them unreadable, tell; the second takes it from `bytes`
  /// instead of adding them, false if it is not of so many parts.
  void pack_parts(std::string& bytes) const;
  bool unpack_parts(std::string_view bytes, std::size_t parts);

  /// The events of a part. If they are not as many as it was added with, the file has changed,
  /// which is told the caller as InputError. Thread safe.
  virtual CompactEvents read_part(std::size_t part) const = 0;

 private:
  using Events = std::shared_ptr<const CompactEvents>;
  Events part(std::size_t number) const;
  /// Calls `take(events, begin, end)` for the places in each part that has some of these.
  template <class Take>
  void for_each_part(std::int64_t first, std::int64_t count, Take take) const;

  std::string name_;
  RecentEvents& recent_;
  std::vector<std::int64_t> firsts_;  ///< the number of each part's first event
  std::int64_t count_ = 0;
  TimeOrder order_;
};

}  // namespace eventgan
