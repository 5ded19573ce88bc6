#include <algorithm>

#include "stages/generator/onednn/plan_cache_internal.h"

namespace eventgan {

std::shared_ptr<const NetworkPlan> PlanCache::plan(ImageSize size) {
  std::promise<std::shared_ptr<const NetworkPlan>> promise;
  {
    std::unique_lock lock(mutex_);
    const auto found = std::ranges::find(latest_first_, size, &Entry::size);
    if (found != latest_first_.end()) {
      latest_first_.splice(latest_first_.begin(), latest_first_, found);
      const Planned plan = found->plan;
      lock.unlock();
      return plan.get();
    }
    latest_first_.push_front({size, promise.get_future().share()});
    if (latest_first_.size() > kKeptPlans) latest_first_.pop_back();
  }
  try {
    const auto plan = std::make_shared<const NetworkPlan>(layers_, size);
    promise.set_value(plan);
    return plan;
  } catch (...) {
    forget(size);
    promise.set_exception(std::current_exception());
    throw;
  }
}

void PlanCache::forget(ImageSize size) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find(latest_first_, size, &Entry::size);
  if (found != latest_first_.end()) latest_first_.erase(found);
}

}  // namespace eventgan
