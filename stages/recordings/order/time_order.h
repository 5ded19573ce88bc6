#pragma once

#include <array>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/recordings/order/event_check.h"

namespace eventgan {

/// A time that steps back by less than this is lifted to the latest before it, as trainers on
/// Prophesee's recordings do: two milliseconds, far below the 4,096 µs of a wrong upper part in EVT
/// 3.0, and half a microsecond less, so that rounding decides of no whole one.
inline constexpr double kMostLift_s = 1.9995e-3;

/// What one look at all times of a recording, in the file's order, has told: between which places
/// the events of a time lie, and of which times no place can be told, since they fall. Places are
/// numbers that grow through the file: of events, or of bytes.
///
/// Times that are not finite are passed over: a stretch of events that has some is refused when it
/// is read.
class TimeOrder {
 public:
  /// Events of these times may lie elsewhere than among those of their time: for no time in
  /// [from_s, until_s) does a place divide the events up to it from those after it.
  struct Fall {
    double from_s = 0;
    double until_s = 0;
    std::int64_t place = 0;            ///< of the first event before an earlier one
    double before_s = 0, after_s = 0;  ///< its predecessors' latest time, and its own
    std::exception_ptr unread = {};    ///< why nothing is known; null: times fall
  };

  /// Places at or behind `begin` and before `end`.
  struct Places {
    std::int64_t begin = 0;
    std::int64_t end = 0;
  };

  /// Times that step back by less than `most_lift_s` are lifted: they are no fall.
  explicit TimeOrder(double most_lift_s = 0) : most_lift_s_(most_lift_s) {}

  /// The next event's time.
  void add(double time_s, std::int64_t place) {
    if (any_ && !is_unread_ && time_s >= latest_s_ &&
        time_s <= std::numeric_limits<double>::max()) {
      latest_s_ = time_s;
    } else {
      add_other(time_s, place);
    }
  }

  /// Those of the events from number `first` on, in blocks that a search reads.
  void add_all(std::span<const double> times_s, std::int64_t first);

  /// What follows, up to the block's end, could not be read: any times may be there.
  void add_unreadable(std::exception_ptr error);

  /// What was added since the last block ended is a block, up to here.
  void end_block(std::int64_t end);

  /// The block with the first event that is later than this, none of which is before it; empty, at
  /// the end, if there is none.
  Places block_after(double time_s) const;

  /// How many times are lifted.
  std::int64_t lifted() const { return lifted_; }

  /// Where the blocks that end at or before a place end, and the latest time in them.
  std::pair<std::int64_t, double> blocks_until(std::int64_t place) const;

  /// What makes the events in (after_s, until_s] uncertain; null: nothing does.
  const Fall* fall_in(double after_s, double until_s) const;

  /// Every one, in the order of their times, none touching another.
  const std::vector<Fall>& falls() const { return falls_; }

  /// Where the last block ends; 0: there is none.
  std::int64_t end() const { return blocks_.empty() ? 0 : blocks_.back().end; }

  /// As it is now, for take_bytes; none where something could not be read, which may be read later.
  std::optional<std::string> to_bytes() const;
  /// Takes these off the front of `bytes`; none if they are no such.
  static std::optional<TimeOrder> take_bytes(std::string_view& bytes);

  /// The earliest and the latest time; none if no time is finite.
  std::optional<std::array<double, 2>> span() const;

 private:
  struct Block {
    std::int64_t end;
    double latest_s;  ///< of all up to it
  };

  void add_other(double time_s, std::int64_t place);
  void add_fall(Fall fall);

  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  double most_lift_s_;
  std::int64_t lifted_ = 0;
  bool any_ = false;
  double earliest_s_ = kInfinity;
  double latest_s_ = -kInfinity;
  bool is_unread_ = false;   ///< the last of the falls_ has no end yet
  bool any_unread_ = false;  ///< its fall may be part of another that is known
  std::vector<Fall> falls_;
  std::vector<Block> blocks_;
};

/// What EventIndexes has under the key of a file whose places end at `end`, else what `look` finds,
/// which it has from then on. Of an empty key always that.
TimeOrder known_order(const std::string& index_key, std::int64_t end,
                      const std::function<TimeOrder()>& look);

/// Nothing where the events of times in (after_s, until_s] lie among the others of theirs; else
/// `refuse(fault, place)`, which throws, is called with what is wrong at which place, or where
/// nothing could be read, what was thrown then is thrown again.
void require_order(const TimeOrder& order, double after_s, double until_s,
                   const std::function<void(const EventFault&, std::int64_t)>& refuse);

}  // namespace eventgan
