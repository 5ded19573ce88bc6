#include "pipeline/finalization/dataset_views.h"

#include <algorithm>
#include <map>
#include <utility>

namespace eventgan {
namespace {

bool alike(const ShardHeader& a, const ShardHeader& b) {
  return a.dataset == b.dataset && a.volume == b.volume && a.label_schema == b.label_schema;
}

std::string kind_of(const ShardHeader& header) {
  const ImageSize& size = header.volume.size;
  return header.dataset + "-" + std::to_string(size.height) + "x" + std::to_string(size.width);
}

void name_groups(std::vector<DatasetView>& views) {
  if (views.size() < 2) return;
  std::map<std::string, int> seen;
  for (DatasetView& view : views) {
    view.group = kind_of(view.header);
    if (const int number = ++seen[view.group]; number > 1) {
      view.group += "-" + std::to_string(number);
    }
  }
}

}  // namespace

std::vector<DatasetView> views_of(const DatasetParts& parts) {
  std::vector<DatasetView> views;
  std::vector<std::vector<ViewShard>> shards;  // of each view
  for (const ShardState& shard : parts.done) {
    // All of a shard's header that a view shows is its source's, but for the size.
    ShardHeader header = parts.headers.at(shard.outline.source);
    header.volume.size = shard.outline.volume_size;
    const auto view = std::ranges::find_if(
        views, [&](const DatasetView& known) { return alike(known.header, header); });
    const auto number = static_cast<std::size_t>(view - views.begin());
    if (view == views.end()) {
      views.push_back({"", std::move(header), {}});
      shards.emplace_back();
    }
    shards[number].push_back({parts.source_of(shard.outline).split, *shard.marker});
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].layout = lay_out_view(std::move(shards[i]));
  }
  name_groups(views);
  return views;
}

}  // namespace eventgan
