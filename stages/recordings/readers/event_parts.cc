#include "stages/recordings/readers/detail/event_parts.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/recordings/order/packed_bytes.h"

namespace eventgan {
namespace {

/// False for NaN as well.
template <class Whole>
bool fits(double value) {
  using Limits = std::numeric_limits<Whole>;
  return value >= Limits::min() && value <= Limits::max() && value == std::trunc(value);
}

}  // namespace

void CompactEvents::reserve(std::size_t count) {
  t_s_.reserve(count);
  x_.reserve(count);
  y_.reserve(count);
  polarity_.reserve(count);
}

void CompactEvents::push_back(const StoredEvent& event) {
  const double polarity = signed_polarity(event.polarity);
  const bool is_whole =
      fits<std::int16_t>(event.x) && fits<std::int16_t>(event.y) && fits<std::int8_t>(polarity);
  if (!is_whole) others_.emplace(size(), event);
  t_s_.push_back(event.t_s);
  x_.push_back(is_whole ? static_cast<std::int16_t>(event.x) : std::int16_t{0});
  y_.push_back(is_whole ? static_cast<std::int16_t>(event.y) : std::int16_t{0});
  polarity_.push_back(is_whole ? static_cast<std::int8_t>(polarity) : std::int8_t{0});
}

void CompactEvents::divide_times(double divisor) {
  for (double& time_s : t_s_) time_s /= divisor;
  for (auto& [place, event] : others_) event.t_s /= divisor;
}

StoredEvent CompactEvents::operator[](std::int64_t place) const {
  if (!others_.empty()) {
    if (const auto other = others_.find(place); other != others_.end()) return other->second;
  }
  const auto i = static_cast<std::size_t>(place);
  return {static_cast<double>(x_[i]), static_cast<double>(y_[i]), t_s_[i],
          static_cast<double>(polarity_[i])};
}

RecentEvents& recent_events() {
  static RecentEvents recent(std::int64_t{1} << 24);
  return recent;
}

void EventParts::add_part(std::int64_t count, double begin_s, double end_s) {
  firsts_.push_back(count_);
  order_.add(begin_s, count_);
  count_ += count;
  order_.add(end_s, count_ - 1);
  order_.end_block(count_);
}

void EventParts::add_part(CompactEvents events) {
  if (events.size() == 0) return;
  firsts_.push_back(count_);
  order_.add_all(events.times_s(), count_);
  count_ += events.size();
  recent_.get({this, firsts_.size() - 1},
              [&] { return std::make_shared<const CompactEvents>(std::move(events)); });
}

void EventParts::pack_parts(std::string& bytes) const {
  pack(bytes, firsts_);
  pack(bytes, count_);
  bytes += order_.to_bytes().value();  // of parts nothing is unreadable
}

bool EventParts::unpack_parts(std::string_view bytes, std::size_t parts) {
  std::vector<std::int64_t> firsts;
  std::int64_t count = 0;
  if (!unpack(bytes, firsts) || firsts.size() != parts || !unpack(bytes, count)) return false;
  auto order = TimeOrder::take_bytes(bytes);
  const auto before = [](std::int64_t a, std::int64_t b) { return a >= b; };
  const bool ascend = std::ranges::adjacent_find(firsts, before) == firsts.end();
  const bool within = firsts.empty() ? count == 0 : firsts[0] == 0 && firsts.back() < count;
  if (!order || order->end() != count || !ascend || !within) return false;
  firsts_ = std::move(firsts);
  count_ = count;
  order_ = *std::move(order);
  return true;
}

EventParts::Events EventParts::part(std::size_t number) const {
  return recent_.get({this, number}, [&] {
    const std::int64_t end = number + 1 < firsts_.size() ? firsts_[number + 1] : count_;
    auto events = std::make_shared<const CompactEvents>(read_part(number));
    if (events->size() == end - firsts_[number]) return events;
    throw InputError("expected " + std::to_string(end - firsts_[number]) +
                     " events as before, got " + std::to_string(events->size()) + ", in " + name_);
  });
}

template <class Take>
void EventParts::for_each_part(std::int64_t first, std::int64_t count, Take take) const {
  const auto behind = std::ranges::upper_bound(firsts_, first);
  for (auto at = static_cast<std::size_t>(behind - firsts_.begin()); count > 0; ++at) {
    const Events events = part(at - 1);
    const std::int64_t begin = first - firsts_[at - 1];
    const std::int64_t end = std::min(begin + count, events->size());
    take(*events, begin, end);
    first += end - begin;
    count -= end - begin;
  }
}

std::vector<StoredEvent> EventParts::read(std::int64_t first, std::int64_t count) const {
  std::vector<StoredEvent> result;
  result.reserve(static_cast<std::size_t>(count));
  for_each_part(first, count,
                [&](const CompactEvents& events, std::int64_t begin, std::int64_t end) {
                  for (std::int64_t i = begin; i < end; ++i) result.push_back(events[i]);
                });
  return result;
}

std::vector<double> EventParts::times_s(std::int64_t first, std::int64_t count) const {
  std::vector<double> result;
  result.reserve(static_cast<std::size_t>(count));
  for_each_part(first, count,
                [&](const CompactEvents& events, std::int64_t begin, std::int64_t end) {
                  const auto times = events.times_s().begin();
                  result.insert(result.end(), times + begin, times + end);
                });
  return result;
}

}  // namespace eventgan
