#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

namespace eventgan {

/// Values by key, of which the least recently used are forgotten when all together pass a number of
/// bytes; one that passes it alone is handed out and not kept. Thread safe; two threads that miss
/// the same key at once both load it, and get equal values.
template <class Key, class Value>
class LruCache {
 public:
  /// `bytes_of` says what a value costs.
  LruCache(std::size_t capacity_bytes, std::function<std::size_t(const Value&)> bytes_of)
      : capacity_bytes_(capacity_bytes), bytes_of_(std::move(bytes_of)) {}

  /// The value kept for the key, or what `load()` gives; its exceptions pass through.
  template <class Load>
  std::shared_ptr<const Value> get(const Key& key, const Load& load) {
    {
      const std::lock_guard lock(mutex_);
      const auto found = entries_.find(key);
      if (found != entries_.end()) {
        order_.splice(order_.begin(), order_, found->second.place);
        return found->second.value;
      }
    }
    // Not under the lock: reading takes long, and others may find what they need meanwhile.
    const auto value = std::make_shared<const Value>(load());
    const std::lock_guard lock(mutex_);
    keep(key, value);
    return value;
  }

  std::size_t kept_bytes() const {
    const std::lock_guard lock(mutex_);
    return kept_bytes_;
  }

 private:
  struct Entry {
    std::shared_ptr<const Value> value;
    std::size_t bytes = 0;
    typename std::list<Key>::iterator place;
  };

  void keep(const Key& key, const std::shared_ptr<const Value>& value) {
    const std::size_t bytes = bytes_of_(*value);
    if (bytes > capacity_bytes_ || entries_.contains(key)) return;
    while (kept_bytes_ + bytes > capacity_bytes_) {
      const auto oldest = entries_.find(order_.back());
      kept_bytes_ -= oldest->second.bytes;
      entries_.erase(oldest);
      order_.pop_back();
    }
    order_.push_front(key);
    entries_[key] = {value, bytes, order_.begin()};
    kept_bytes_ += bytes;
  }

  std::size_t capacity_bytes_;
  std::function<std::size_t(const Value&)> bytes_of_;
  mutable std::mutex mutex_;
  std::size_t kept_bytes_ = 0;
  std::list<Key> order_;  // most recently used first
  std::map<Key, Entry> entries_;
};

}  // namespace eventgan
