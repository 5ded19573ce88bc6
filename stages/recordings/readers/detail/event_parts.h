#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stages/recordings/order/event_check.h"
#include "stages/recordings/readers/detail/recently_used.h"
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

/// The events that were read last, of the whole process: sixteen million, or 220 MB.
RecentlyUsed& recent_events();

/// The events of a file that is read in parts: a table as a whole, the packets of AEDAT4. A part is
/// read when one of its events is first asked for, and then as long as recent_events() keeps it,
/// not again.
class EventParts : public EventStore {
 public:
  ~EventParts() override { recent_.forget(this); }

  std::int64_t count() const final { return count_; }
  std::vector<StoredEvent> read(std::int64_t first, std::int64_t count) const final;
  std::vector<double> times_s(std::int64_t first, std::int64_t count) const final;

  /// Known since it was opened.
  EventOrder order() const final { return order_; }

 protected:
  /// `name` is for messages.
  explicit EventParts(std::string name, RecentlyUsed& recent = recent_events())
      : name_(std::move(name)), recent_(recent) {}

  /// While it is opened: the next part, which has events of times from `begin_s` to `end_s`.
  void add_part(std::int64_t count, double begin_s, double end_s);
  /// The same, of what has been read already; nothing if it is empty.
  void add_part(CompactEvents events);

  /// What the parts added so far tell; the second takes it from `bytes` instead of adding them,
  /// false if it is not of so many parts.
  void pack_parts(std::string& bytes) const;
  bool unpack_parts(std::string_view bytes, std::size_t parts);

  /// The events of a part. If they are not as many as it was added with, the file has changed,
  /// which is told the caller as InputError. Thread safe.
  virtual CompactEvents read_part(std::size_t part) const = 0;

 private:
  using Events = std::shared_ptr<const CompactEvents>;
  /// The part as it is kept, else what `read` gives.
  Events kept_part(std::size_t number, const std::function<CompactEvents()>& read) const;
  Events part(std::size_t number) const;
  /// Calls `take(events, begin, end)` for the places in each part that has some of these.
  template <class Take>
  void for_each_part(std::int64_t first, std::int64_t count, Take take) const;

  std::string name_;
  RecentlyUsed& recent_;
  std::vector<std::int64_t> firsts_;  ///< the number of each part's first event
  std::int64_t count_ = 0;
  EventOrder order_;
};

}  // namespace eventgan
