#include "stages/recordings/readers/detail/recently_used.h"

#include <iterator>
#include <vector>

namespace eventgan {

RecentlyUsed::Value RecentlyUsed::get(const void* owner, std::size_t number,
                                      const std::function<Made()>& make) {
  const Key key(owner, number);
  std::vector<std::shared_ptr<Entry>> gone;  // first, so that they end last
  std::shared_ptr<Entry> entry;
  {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<Entry>& kept = entries_[key];
    if (!kept) {
      kept = std::make_shared<Entry>();
      kept->age = ages_.insert(ages_.begin(), key);
    }
    ages_.splice(ages_.begin(), ages_, kept->age);
    entry = kept;
  }
  const std::lock_guard making(entry->making);
  if (entry->value) return entry->value;
  Made made = make();
  entry->value = std::move(made.value);

  const std::lock_guard lock(mutex_);
  const auto kept = entries_.find(key);
  if (kept == entries_.end() || kept->second != entry) return entry->value;  // dropped meanwhile
  entry->counted = made.weight;
  kept_ += entry->counted;
  ages_.splice(ages_.begin(), ages_, entry->age);
  // Not those that are being made, which have nothing to free: they would be made again.
  for (auto age = std::prev(ages_.end()); kept_ > most_ && age != ages_.begin();) {
    const auto oldest = entries_.find(*age--);
    if (oldest->second->counted > 0) gone.push_back(take_out(oldest));
  }
  return entry->value;
}

void RecentlyUsed::forget(const void* owner) {
  std::vector<std::shared_ptr<Entry>> gone;
  const std::lock_guard lock(mutex_);
  for (;;) {
    const auto next = entries_.lower_bound(Key(owner, 0));
    if (next == entries_.end() || next->first.first != owner) return;
    gone.push_back(take_out(next));
  }
}

std::shared_ptr<RecentlyUsed::Entry> RecentlyUsed::take_out(Entries::iterator entry) {
  std::shared_ptr<Entry> gone = std::move(entry->second);
  kept_ -= gone->counted;
  ages_.erase(gone->age);
  entries_.erase(entry);
  return gone;
}

}  // namespace eventgan
