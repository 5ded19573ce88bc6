#include "pipeline/planning/shard_layout.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

namespace eventgan {

ShardLayout::ShardLayout(std::string name, int samples_per_shard)
    : name_(std::move(name)), samples_per_shard_(static_cast<std::size_t>(samples_per_shard)) {}

void ShardLayout::begin_source(int source, const std::string& split) {
  end_source();
  source_ = source;
  split_ = split;
}

void ShardLayout::add(PlannedSample sample, ImageSize volume_size) {
  if (volume_size == ImageSize{}) {
    append_unknown(std::move(sample));
  } else {
    append(group(volume_size), std::move(sample));
  }
}

std::vector<PlannedShard> ShardLayout::finish() {
  end_source();
  std::map<std::string, std::size_t> totals;
  for (const std::string& split : splits_) ++totals[split];
  std::map<std::string, std::size_t> next;
  for (std::size_t i = 0; i < shards_.size(); ++i) {
    shards_[i].name = fmt::format("{}-{}-{:05}-of-{:05}.h5", name_, splits_[i], next[splits_[i]]++,
                                  totals[splits_[i]]);
  }
  splits_.clear();
  return std::exchange(shards_, {});
}

ShardLayout::Group& ShardLayout::group(ImageSize size) {
  const auto [entry, is_new] = group_index_.try_emplace({size.height, size.width}, groups_.size());
  if (is_new) groups_.push_back({size, {}, {}});
  return groups_[entry->second];
}

void ShardLayout::append(Group& group, PlannedSample sample) {
  if (group.samples++ % samples_per_shard_ == 0) {
    group.shards.push_back({"", source_, group.size, {}});
  }
  group.shards.back().samples.push_back(std::move(sample));
}

void ShardLayout::append_unknown(PlannedSample sample) {
  const auto takes = [&](const PlannedShard& shard) {
    return shard.samples.size() < samples_per_shard_ &&
           shard.samples.back().pair.next.path == sample.pair.next.path;
  };
  if (unknown_.empty() || !takes(unknown_.back())) {
    unknown_.push_back({"", source_, {}, {}, /*size_unknown=*/true});
  }
  unknown_.back().samples.push_back(std::move(sample));
}

ImageSize ShardLayout::most_common_size() const {
  if (groups_.empty()) return {1, 1};
  return std::ranges::max_element(groups_, {}, &Group::samples)->size;
}

void ShardLayout::end_source() {
  for (PlannedShard& shard : unknown_) shard.volume_size = most_common_size();
  for (Group& group : groups_) std::ranges::move(group.shards, std::back_inserter(shards_));
  std::ranges::move(unknown_, std::back_inserter(shards_));
  splits_.resize(shards_.size(), split_);
  groups_.clear();
  group_index_.clear();
  unknown_.clear();
}

}  // namespace eventgan
