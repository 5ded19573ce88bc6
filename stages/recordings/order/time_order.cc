#include "stages/recordings/order/time_order.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/recordings/order/event_index.h"
#include "stages/recordings/order/packed_bytes.h"

namespace eventgan {

void TimeOrder::add_other(double time_s, std::int64_t place) {
  if (!std::isfinite(time_s)) return;
  const bool is_in_fall = !falls_.empty() && falls_.back().until_s >= latest_s_;
  if (time_s < latest_s_ && time_s > latest_s_ - most_lift_s_ && !is_in_fall) {
    ++lifted_;
    return;
  }
  const double before_s = latest_s_;
  latest_s_ = std::max(latest_s_, time_s);
  earliest_s_ = std::min(earliest_s_, time_s);
  any_ = true;
  if (std::exchange(is_unread_, false)) falls_.back().until_s = latest_s_;
  if (time_s < before_s) add_fall({time_s, before_s, place, before_s, time_s});
}

void TimeOrder::add_unreadable(std::exception_ptr error) {
  add_fall({latest_s_, kInfinity, 0, latest_s_, latest_s_, std::move(error)});
  is_unread_ = any_unread_ = true;
}

void TimeOrder::add_all(std::span<const double> times_s, std::int64_t first) {
  constexpr std::int64_t kEventsPerBlock = std::int64_t{1} << 13;
  for (const double time_s : times_s) {
    add(time_s, first);
    if (++first % kEventsPerBlock == 0) end_block(first);
  }
  end_block(first);
}

/// Falls end at ever later times, so that only the last ones can touch a new one.
void TimeOrder::add_fall(Fall fall) {
  constexpr std::size_t kMost = std::size_t{1} << 16;  // beyond it they are taken together
  while (!falls_.empty() && (falls_.back().until_s >= fall.from_s || falls_.size() == kMost)) {
    const double from_s = std::min(falls_.back().from_s, fall.from_s), until_s = fall.until_s;
    fall = std::move(falls_.back());
    fall.from_s = from_s;
    fall.until_s = std::max(fall.until_s, until_s);
    falls_.pop_back();
  }
  falls_.push_back(std::move(fall));
}

void TimeOrder::end_block(std::int64_t end) {
  if (end == this->end()) return;
  blocks_.push_back({end, latest_s_});
}

TimeOrder::Places TimeOrder::block_after(double time_s) const {
  const auto block = std::ranges::upper_bound(blocks_, time_s, {}, &Block::latest_s);
  const std::int64_t begin = block == blocks_.begin() ? 0 : std::prev(block)->end;
  return {begin, block == blocks_.end() ? begin : block->end};
}

std::pair<std::int64_t, double> TimeOrder::blocks_until(std::int64_t place) const {
  const auto block = std::ranges::upper_bound(blocks_, place, {}, &Block::end);
  if (block == blocks_.begin()) return {0, -kInfinity};
  return {std::prev(block)->end, std::prev(block)->latest_s};
}

const TimeOrder::Fall* TimeOrder::fall_in(double after_s, double until_s) const {
  const auto fall = std::ranges::upper_bound(falls_, after_s, {}, &Fall::until_s);
  if (fall != falls_.end() && fall->from_s <= until_s) return &*fall;
  return nullptr;
}

std::optional<std::array<double, 2>> TimeOrder::span() const {
  if (!any_) return std::nullopt;
  return std::array{earliest_s_, latest_s_};
}

namespace {

/// TimeOrder::Fall as bytes.
struct PackedFall {
  double from_s = 0, until_s = 0;
  std::int64_t place = 0;
  double before_s = 0, after_s = 0;
};

}  // namespace

std::optional<std::string> TimeOrder::to_bytes() const {
  if (any_unread_) return std::nullopt;
  std::vector<PackedFall> falls;
  for (const Fall& fall : falls_) {
    falls.push_back({fall.from_s, fall.until_s, fall.place, fall.before_s, fall.after_s});
  }
  std::string bytes;
  pack(bytes, lifted_);
  pack(bytes, any_);
  pack(bytes, earliest_s_);
  pack(bytes, latest_s_);
  pack(bytes, falls);
  pack(bytes, blocks_);
  return bytes;
}

std::optional<TimeOrder> TimeOrder::take_bytes(std::string_view& bytes) {
  TimeOrder order;
  std::vector<PackedFall> falls;
  if (!unpack(bytes, order.lifted_) || !unpack(bytes, order.any_) ||
      !unpack(bytes, order.earliest_s_) || !unpack(bytes, order.latest_s_) ||
      !unpack(bytes, falls) || !unpack(bytes, order.blocks_)) {
    return std::nullopt;
  }
  std::int64_t before = 0;
  for (const Block& block : order.blocks_) {
    if (block.end <= std::exchange(before, block.end)) return std::nullopt;
  }
  for (const PackedFall& fall : falls) {
    order.falls_.push_back({fall.from_s, fall.until_s, fall.place, fall.before_s, fall.after_s});
  }
  return order;
}

TimeOrder known_order(const std::string& index_key, std::int64_t end,
                      const std::function<TimeOrder()>& look) {
  EventIndexes* const indexes = index_key.empty() ? nullptr : EventIndexes::current();
  if (indexes == nullptr) return look();
  if (const auto bytes = indexes->find(index_key)) {
    std::string_view rest = *bytes;
    auto order = TimeOrder::take_bytes(rest);
    if (order && rest.empty() && order->end() == end) return *std::move(order);
  }
  TimeOrder order = look();
  if (auto bytes = order.to_bytes()) indexes->keep(index_key, *std::move(bytes));
  return order;
}

void require_order(const TimeOrder& order, double after_s, double until_s,
                   const std::function<void(const EventFault&, std::int64_t)>& refuse) {
  const TimeOrder::Fall* const fall = order.fall_in(after_s, until_s);
  if (fall == nullptr) return;
  if (fall->unread) std::rethrow_exception(fall->unread);
  try {
    check_event_time(fall->before_s, fall->after_s);
  } catch (const EventFault& fault) {
    refuse(fault, fall->place);
  }
}

}  // namespace eventgan
