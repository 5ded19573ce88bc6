#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

namespace eventgan {

/// What was used last, whoever uses it, so that windows and threads share it: what was used longest
/// ago goes where all that is kept weighs more than `most`, but never the latest. It ends once
/// nobody uses it. Thread safe: of several threads that ask for the same, one makes it and the
/// others wait for it.
class RecentlyUsed {
 public:
  using Value = std::shared_ptr<const void>;
  struct Made {
    Value value;
    std::int64_t weight = 0;
  };

  explicit RecentlyUsed(std::int64_t most) : most_(most) {}

  /// The owner's value of this number: what `make` gives, unless it is kept. What it throws passes
  /// through.
  Value get(const void* owner, std::size_t number, const std::function<Made()>& make);

  /// Of an owner that is gone.
  void forget(const void* owner);

 private:
  using Key = std::pair<const void*, std::size_t>;
  struct Entry {
    std::mutex making;
    Value value;               ///< null until it is made; guarded by `making`
    std::int64_t counted = 0;  ///< of kept_
    std::list<Key>::iterator age;
  };
  using Entries = std::map<Key, std::shared_ptr<Entry>>;
  /// The entry, which goes: its value ends with it, which may need a lock that others hold who wait
  /// for this one.
  std::shared_ptr<Entry> take_out(Entries::iterator entry);

  const std::int64_t most_;
  std::mutex mutex_;  ///< of all but `Entry::value`
  Entries entries_;
  std::list<Key> ages_;  ///< the one used last is first
  std::int64_t kept_ = 0;
};

}  // namespace eventgan
