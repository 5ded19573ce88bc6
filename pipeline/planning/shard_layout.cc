#include "pipeline/planning/shard_layout.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <utility>

namespace eventgan {
namespace {

std::string numbered(const std::string& prefix, std::size_t index, std::size_t count) {
  char text[32];
  std::snprintf(text, sizeof text, "-%05zu-of-%05zu.h5", index, count);
  return prefix + text;
}

/// Samples of one size, by their place in the source.
struct SizeGroup {
  ImageSize size;
  std::vector<std::size_t> samples;
};

/// Groups in the order of their first sample; samples of unknown size join the largest group.
std::vector<SizeGroup> group_by_size(const std::vector<ImageSize>& sizes) {
  std::vector<SizeGroup> groups;
  std::map<std::pair<int, int>, std::size_t> index;
  std::vector<std::size_t> unknown;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (sizes[i] == ImageSize{}) {
      unknown.push_back(i);
      continue;
    }
    const auto [entry, is_new] =
        index.try_emplace({sizes[i].height, sizes[i].width}, groups.size());
    if (is_new) groups.push_back({sizes[i], {}});
    groups[entry->second].samples.push_back(i);
  }
  if (unknown.empty()) return groups;
  if (groups.empty()) groups.push_back({ImageSize{1, 1}, {}});
  auto& largest = std::max_element(groups.begin(), groups.end(), [](const auto& a, const auto& b) {
                    return a.samples.size() < b.samples.size();
                  })->samples;
  const auto middle = static_cast<std::ptrdiff_t>(largest.size());
  largest.insert(largest.end(), unknown.begin(), unknown.end());
  std::inplace_merge(largest.begin(), largest.begin() + middle, largest.end());
  return groups;
}

}  // namespace

std::vector<PlannedShard> lay_out_shards(const std::string& name, std::vector<SizedSamples> sources,
                                         int samples_per_shard) {
  std::vector<PlannedShard> shards;
  std::vector<std::string> splits;  // of each shard
  for (SizedSamples& source : sources) {
    for (const SizeGroup& group : group_by_size(source.volume_sizes)) {
      for (std::size_t i = 0; i < group.samples.size(); ++i) {
        if (i % static_cast<std::size_t>(samples_per_shard) == 0) {
          shards.push_back({"", source.source, group.size, {}});
          splits.push_back(source.split);
        }
        shards.back().samples.push_back(std::move(source.samples[group.samples[i]]));
      }
    }
  }
  std::map<std::string, std::size_t> totals;
  for (const std::string& split : splits) ++totals[split];
  std::map<std::string, std::size_t> next;
  for (std::size_t i = 0; i < shards.size(); ++i) {
    shards[i].name = numbered(name + "-" + splits[i], next[splits[i]]++, totals[splits[i]]);
  }
  return shards;
}

}  // namespace eventgan
