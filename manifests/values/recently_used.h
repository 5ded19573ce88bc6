#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <future>
#include <iterator>
#include <list>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

namespace eventgan {

/// Values by key, each made when it is first asked for. Once all weigh more than `most`, those used
/// longest ago go, but never the latest. A value is cheap to copy (a shared_ptr), so that who uses
/// it keeps it.
///
/// Thread safe. Of several threads that ask for one value the first makes it and the others wait;
/// no lock is held meanwhile, so different values are made in parallel.
template <class Key, class Value>
class RecentlyUsed {
 public:
  /// `weight_of` a value, not negative; without it each weighs 1.
  explicit RecentlyUsed(std::int64_t most,
                        std::function<std::int64_t(const Value&)> weight_of = nullptr)
      : most_(most), weight_of_(std::move(weight_of)) {}

  /// The value kept, or under way in another thread, or else what `make` returns. What `make`
  /// throws reaches all that wait for the value; the next call makes it again. `make` must not ask
  /// for its own key, nor lend its thread to tasks that may.
  template <class Make>
  Value get(const Key& key, const Make& make) {
    std::vector<Result> gone;  // first: a value's end may wait for a lock whose holder waits here
    std::promise<Value> promise;
    std::unique_lock lock(mutex_);
    const auto [place, is_new] = entries_.try_emplace(key);
    Entry& entry = place->second;
    if (is_new) {
      entry.result = promise.get_future().share();
      entry.age = ages_.insert(ages_.begin(), place);
    } else {
      ages_.splice(ages_.begin(), ages_, entry.age);
    }
    const Result result = entry.result;
    lock.unlock();
    if (!is_new) return result.get();
    try {
      promise.set_value(make());
    } catch (...) {
      lock.lock();
      take_out(place);
      promise.set_exception(std::current_exception());
      throw;
    }
    const std::int64_t weight = weight_of_ ? weight_of_(result.get()) : 1;
    lock.lock();
    entry.weight = weight;
    entry.is_made = true;
    weight_ += weight;
    ages_.splice(ages_.begin(), ages_, entry.age);
    for (auto age = std::prev(ages_.end()); weight_ > most_ && age != ages_.begin();) {
      const auto oldest = *age--;
      if (oldest->second.is_made) gone.push_back(take_out(oldest));
    }
    return result.get();
  }

  /// Whether `get` would not call `make`, at this moment.
  bool has(const Key& key) const {
    const std::lock_guard lock(mutex_);
    return entries_.contains(key);
  }

  /// Drops the values of keys from `first` to `last`, both included, for which nobody asks now.
  void forget(const Key& first, const Key& last) {
    std::vector<Result> gone;
    const std::lock_guard lock(mutex_);
    const auto end = entries_.upper_bound(last);
    for (auto next = entries_.lower_bound(first); next != end;) gone.push_back(take_out(next++));
  }

 private:
  using Result = std::shared_future<Value>;
  struct Entry;
  using Entries = std::map<Key, Entry>;
  using Ages = std::list<typename Entries::iterator>;
  struct Entry {
    Result result;
    std::int64_t weight = 0;
    bool is_made = false;  ///< until then it stays, since it would be made again
    typename Ages::iterator age;
  };

  Result take_out(typename Entries::iterator place) {
    Result gone = std::move(place->second.result);
    weight_ -= place->second.weight;
    ages_.erase(place->second.age);
    entries_.erase(place);
    return gone;
  }

  const std::int64_t most_;
  const std::function<std::int64_t(const Value&)> weight_of_;
  mutable std::mutex mutex_;  ///< of all below
  Entries entries_;
  Ages ages_;  ///< the one used last is first
  std::int64_t weight_ = 0;
};

}  // namespace eventgan
