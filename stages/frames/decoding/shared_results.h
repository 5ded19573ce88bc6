#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <functional>
#include <future>
#include <list>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

namespace eventgan {

/// The results used last, of images by their names, so that those who share one make it once.
/// `Result` is cheap to copy (a shared_ptr).
///
/// Thread safe. Of several threads that want one result at the same time the first makes it and
/// the others wait for it; no lock is held meanwhile, so different ones are made in parallel. A
/// thread waits only for one that is making a result and itself waits for none: no deadlock.
template <class Result>
class SharedResults {
 public:
  /// Keeps `most` results (at least one), whatever their size.
  explicit SharedResults(std::size_t most) : most_(std::max<std::size_t>(most, 1)) {}

  /// The result of that name: kept, or under way in another thread, or else what `make` returns.
  /// What `make` throws is kept like a result: every `get` that finds it throws the same. `make`
  /// must not call `get`, nor lend its thread to tasks that may (as an algorithm that runs in
  /// parallel in the same thread pool does).
  Result get(const std::string& name, const std::function<Result()>& make) {
    std::promise<Result> promise;
    {
      std::unique_lock lock(mutex_);
      if (const auto found = by_name_.find(name); found != by_name_.end()) {
        kept_.splice(kept_.begin(), kept_, found->second);
        const std::shared_future<Result> result = found->second->result;
        lock.unlock();
        return result.get();
      }
      add(name, promise.get_future().share());
    }
    try {
      Result result = make();
      promise.set_value(result);
      return result;
    } catch (...) {
      promise.set_exception(std::current_exception());
      throw;
    }
  }

  /// Whether `get` would not call `make`, at this moment.
  bool has(const std::string& name) {
    const std::lock_guard lock(mutex_);
    return by_name_.contains(name);
  }

 private:
  struct Kept {
    std::string name;
    std::shared_future<Result> result;
  };

  /// Puts a promised result in front, and the one unused for longest out.
  void add(const std::string& name, std::shared_future<Result> result) {
    kept_.push_front({name, std::move(result)});
    by_name_[kept_.front().name] = kept_.begin();
    if (kept_.size() <= most_) return;
    by_name_.erase(kept_.back().name);
    kept_.pop_back();
  }

  std::size_t most_;
  std::mutex mutex_;
  std::list<Kept> kept_;  ///< most recently used first
  std::unordered_map<std::string_view, typename std::list<Kept>::iterator> by_name_;
};

}  // namespace eventgan
