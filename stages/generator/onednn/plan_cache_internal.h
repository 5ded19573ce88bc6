#pragma once

#include <cstddef>
#include <future>
#include <list>
#include <memory>
#include <mutex>

#include "manifests/image_size.h"
#include "stages/generator/onednn/network_layers_internal.h"
#include "stages/generator/onednn/network_plan_internal.h"

namespace eventgan {

/// Plans for the 16 picture sizes used last: KITTI has a handful of sizes, a folder of pictures any
/// number. A plan that is in use lives on when it is dropped here. Thread safe.
class PlanCache {
 public:
  /// `layers` must outlive it.
  explicit PlanCache(NetworkLayers& layers) : layers_(layers) {}

  /// Builds the plan if it is not there; who asks for one that another thread builds waits for it,
  /// and gets its exception if there is one. Throws dnnl::error; the next call tries again.
  std::shared_ptr<const NetworkPlan> plan(ImageSize size);

 private:
  static constexpr std::size_t kKeptPlans = 16;
  using Planned = std::shared_future<std::shared_ptr<const NetworkPlan>>;
  struct Entry {
    ImageSize size;
    Planned plan;
  };

  void forget(ImageSize size);

  NetworkLayers& layers_;
  std::mutex mutex_;
  std::list<Entry> latest_first_;
};

}  // namespace eventgan
