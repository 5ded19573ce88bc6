#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>
#include <vector>

#include "stages/generator/onednn/plan_cache_internal.h"
#include "stages/generator/untrained.h"

namespace eventgan {
namespace {

using Plan = std::shared_ptr<const NetworkPlan>;

NetworkLayers layers_of(const Weights& weights) {
  return {weights, Precision::kFloat32, dnnl::engine(dnnl::engine::kind::cpu, 0)};
}

TEST(PlanCache, KeepsThePlansOfTheLatestSizes) {
  NetworkLayers layers = layers_of(untrained_weights(1, 1, 1));
  PlanCache cache(layers);
  const Plan first = cache.plan({4, 4});
  for (int width = 5; width < 20; ++width) cache.plan({4, width});  // 16 sizes
  EXPECT_EQ(cache.plan({4, 4}), first);
  cache.plan({4, 20});  // and 5 is the one that was not used for longest
  EXPECT_EQ(cache.plan({4, 4}), first);
  for (int width = 5; width < 21; ++width) cache.plan({4, width});
  EXPECT_NE(cache.plan({4, 4}), first) << "a cache without bounds";
}

TEST(PlanCache, BuildsOnePlanForManyThreads) {
  NetworkLayers layers = layers_of(untrained_weights(2, 9, 1));
  PlanCache cache(layers);
  std::vector<Plan> plans(8);
  std::vector<std::jthread> threads;
  for (Plan& plan : plans) threads.emplace_back([&] { plan = cache.plan({30, 41}); });
  threads.clear();
  for (const Plan& plan : plans) EXPECT_EQ(plan, plans[0]);
}

TEST(PlanCache, TellsEveryCallOfAFailureAndTriesAgain) {
  Weights weights = untrained_weights(1, 1, 1);
  weights.convolutions.pop_back();  // no plan without a last layer
  NetworkLayers layers = layers_of(weights);
  PlanCache cache(layers);
  std::vector<int> failures(4);
  std::vector<std::jthread> threads;
  for (int& count : failures) {
    threads.emplace_back([&] {
      for (int call = 0; call < 3; ++call) {
        try {
          cache.plan({8, 8});
        } catch (const std::out_of_range&) {
          ++count;
        }
      }
    });
  }
  threads.clear();
  EXPECT_EQ(failures, std::vector<int>(4, 3));
}

}  // namespace
}  // namespace eventgan
