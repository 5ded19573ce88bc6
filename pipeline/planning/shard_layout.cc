#include "pipeline/planning/shard_layout.h"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <map>
#include <utility>

namespace eventgan {
namespace {

std::string numbered(const std::string& prefix, std::size_t index, std::size_t count) {
  char text[32];
  std::snprintf(text, sizeof text, "-%05zu-of-%05zu.h5", index, count);
  return prefix + text;
}

}  // namespace

ShardLayout::ShardLayout(std::string name, int samples_per_shard)
    : name_(std::move(name)), samples_per_shard_(static_cast<std::size_t>(samples_per_shard)) {}

void ShardLayout::begin_source(int source, const std::string& split) {
  end_source();
  source_ = source;
  split_ = split;
}

void ShardLayout::add(PlannedSample sample, ImageSize volume_size) {
  append(volume_size == ImageSize{} ? unknown_ : group(volume_size), next_place_++,
         std::move(sample));
}

std::vector<PlannedShard> ShardLayout::finish() {
  end_source();
  std::map<std::string, std::size_t> totals;
  for (const std::string& split : splits_) ++totals[split];
  std::map<std::string, std::size_t> next;
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    shards_[i].name = numbered(name_ + "-" + splits_[i], next[splits_[i]]++, totals[splits_[i]]);
  }
  splits_.clear();
  return std::exchange(shards_, {});
}

ShardLayout::Group& ShardLayout::group(ImageSize size) {
  const auto [entry, is_new] = group_index_.try_emplace({size.height, size.width}, groups_.size());
  if (is_new) groups_.push_back({size, {}, {}});
  return groups_[entry->second];
}

void ShardLayout::append(Group& group, std::size_t place, PlannedSample sample) {
  if (group.shards.empty() || group.shards.back().samples.size() == samples_per_shard_) {
    group.shards.push_back({"", source_, group.size, {}});
  }
  group.shards.back().samples.push_back(std::move(sample));
  group.places.push_back(place);
}

void ShardLayout::place_unknown() {
  if (unknown_.places.empty()) return;
  if (groups_.empty()) group({1, 1});
  const auto count = [](const Group& group) { return group.places.size(); };
  Group& largest = *std::ranges::max_element(groups_, {}, count);

  using Placed = std::pair<std::size_t, PlannedSample>;
  std::vector<Placed> merged;
  const auto take = [&merged](Group& group) {
    std::size_t taken = 0;
    for (PlannedShard& shard : group.shards) {
      for (PlannedSample& sample : shard.samples)
        merged.emplace_back(group.places[taken++], std::move(sample));
    }
    group.shards.clear();
    group.places.clear();
  };
  take(largest);
  take(unknown_);
  std::ranges::sort(merged, {}, &Placed::first);
  for (Placed& placed : merged) append(largest, placed.first, std::move(placed.second));
}

void ShardLayout::end_source() {
  place_unknown();
  for (Group& group : groups_) {
    std::ranges::move(group.shards, std::back_inserter(shards_));
    splits_.resize(shards_.size(), split_);
  }
  groups_.clear();
  group_index_.clear();
  next_place_ = 0;
}

}  // namespace eventgan
