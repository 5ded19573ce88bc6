#include "pipeline/conversion/earlier_shards.h"

#include <cstddef>
#include <stdexcept>
#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/plan.h"
#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

/// Empty if somebody has taken it away meanwhile.
std::string commit_record_text(const std::filesystem::path& folder, const std::string& shard) {
  try {
    return read_text_file(folder / commit_record_name(shard));
  } catch (const std::runtime_error&) {
    return "";
  }
}

}  // namespace

EarlierShards check_earlier_shards(const std::filesystem::path& folder, const FrozenPlan& frozen,
                                   const std::vector<const PlannedShard*>& shards,
                                   const ScanOptions& options) {
  std::vector<ShardState> states =
      scan_shards(folder, outlines_of(shards), frozen.hash, ScanDepth::kRecord, options);
  scan_again(folder, frozen.hash, /*done=*/true, states, ScanDepth::kRows, options);

  EarlierShards earlier;
  for (std::size_t i = 0; i < shards.size(); ++i) {
    if (states[i].done()) {
      earlier.done.push_back({shards[i], *std::move(states[i].record)});
      continue;
    }
    earlier.left.push_back(shards[i]);
    earlier.faults.insert(earlier.faults.end(), states[i].faults.begin(), states[i].faults.end());
    if (states[i].condition == ShardCondition::kOtherBytes) earlier.distrusted[shards[i]->name];
    if (states[i].condition == ShardCondition::kOtherCounts) {
      earlier.distrusted[shards[i]->name] = commit_record_text(folder, shards[i]->name);
    }
  }
  return earlier;
}

std::int64_t count_quarantined(const std::filesystem::path& folder, const FrozenPlan& frozen,
                               const std::vector<const PlannedShard*>& shards,
                               const ScanOptions& options) {
  std::int64_t count = 0;
  for (const ShardState& state :
       scan_shards(folder, outlines_of(shards), frozen.hash, ScanDepth::kRecord, options)) {
    if (state.done()) count += std::ssize(state.record->quarantined);
  }
  return count;
}

}  // namespace eventgan
