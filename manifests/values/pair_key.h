#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>

#include "manifests/values/counter_random.h"
#include "manifests/values/job.h"

namespace eventgan {

/// What a pair's random numbers are keyed by, as the plan's are: they depend on no other sample, on
/// no worker and on no shard.
struct PairKey {
  std::uint64_t seed = 0;
  std::string_view dataset;
  std::string_view sample_id;

  /// The pair's own; keyed on by a word for each thing that is drawn.
  CounterRandom pair() const { return CounterRandom(seed).keyed(dataset).keyed(sample_id); }

  /// Those of the camera, which all pairs of a kind of dataset share.
  CounterRandom camera() const { return CounterRandom(seed).keyed("camera").keyed(dataset); }
};

/// The contrast threshold of a pair's sensor, its mean drawn log-uniformly from the range that the
/// manifest tells; none if it tells none. Pure.
inline std::optional<ContrastThreshold> pair_threshold(const GeneratorSpec& spec,
                                                       const PairKey& key) {
  if (!spec.threshold) return std::nullopt;
  const auto [least, most] = spec.threshold->range;
  const double share = key.pair().keyed("threshold").uniform(0);
  return ContrastThreshold{std::min(least * std::pow(most / least, share), most),
                           spec.threshold->ratio};
}

}  // namespace eventgan
