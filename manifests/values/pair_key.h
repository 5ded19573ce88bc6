#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/job.h"

namespace eventgan {

/// What a pair's random numbers are keyed by, as the plan's are: they depend on no other sample, on
/// no worker and on no shard.
struct PairKey {
  std::uint64_t seed = 0;
  std::string_view dataset;
  std::string_view sample_id;
  std::string_view source = {};  ///< source_key of the sample's source
  std::uint64_t draw = 0;        ///< which of the draws for the pair; 0 is that of shards

  /// The pair's own; keyed on by a word for each thing that is drawn.
  CounterRandom pair() const {
    const CounterRandom of_kind = CounterRandom(seed).keyed(dataset);
    const CounterRandom of_pair =
        (source.empty() ? of_kind : of_kind.keyed(source)).keyed(sample_id);
    return draw == 0 ? of_pair : of_pair.keyed(std::to_string(draw));
  }

  /// Those of the camera, which all pairs of a kind of dataset share.
  CounterRandom camera() const { return CounterRandom(seed).keyed("camera").keyed(dataset); }
};

/// What tells a source's draws from those of the others of its kind, whose samples may have the
/// same ids: the split, unless that is train; and of the roots of one split their number in the
/// manifest's order, but for the first. So it does not matter where the data lies, the only source
/// of a job has none, and one that is added at the end moves no pair of another.
inline std::string source_key(const std::vector<SourceSpec>& sources, std::size_t source) {
  const SourceSpec& own = sources.at(source);
  std::vector<std::string_view> roots;  // of its kind and split
  for (const SourceSpec& other : sources) {
    if (other.dataset == own.dataset && other.split == own.split &&
        std::ranges::find(roots, other.root) == roots.end()) {
      roots.push_back(other.root);
    }
  }
  const auto number = std::ranges::find(roots, own.root) - roots.begin();
  const std::string split = own.split == "train" ? "" : own.split;
  return number == 0 ? split : split + "\n" + std::to_string(number);
}

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
