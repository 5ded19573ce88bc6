#include "pipeline/conversion/earlier_shards.h"

#include <fmt/core.h>

#include <atomic>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include "manifests/plan_outline.h"
#include "pipeline/output/shard_state.h"
#include "pipeline/profile/trace_span.h"
#include "pipeline/threads/for_each_index.h"
#include "stages/files/text_file.h"

namespace eventgan {
namespace {

/// Some ten seconds of hashing.
constexpr std::int64_t kNotedBytes = 4'000'000'000;

bool is_stopped(const EarlierCheck& check) { return check.stop && check.stop(); }

void tell_if_long(const std::vector<ShardState>& states, const EarlierCheck& check) {
  int done = 0;
  std::int64_t bytes = 0;
  for (const ShardState& state : states) {
    if (!state.done()) continue;
    ++done;
    bytes += state.marker->size_bytes;
  }
  if (!check.note || bytes < kNotedBytes) return;
  check.note(fmt::format("checking {} committed shards ({:.1f} GB)", done,
                         1e-9 * static_cast<double>(bytes)));
}

/// Empty if somebody has taken it away meanwhile.
std::string marker_text(const std::filesystem::path& folder, const std::string& shard) {
  try {
    return read_text_file(folder / marker_name(shard));
  } catch (const std::runtime_error&) {
    return "";
  }
}

}  // namespace

EarlierShards check_earlier_shards(const std::filesystem::path& folder, const FrozenPlan& frozen,
                                   const std::vector<const PlannedShard*>& shards,
                                   const EarlierCheck& check) {
  std::vector<ShardState> states(shards.size());
  for_each_index(shards.size(), check.threads, [&](std::size_t i) {
    if (!is_stopped(check)) states[i] = shard_state(folder, outline_of(*shards[i]), frozen.hash);
  });
  tell_if_long(states, check);
  for_each_index(shards.size(), check.threads, [&](std::size_t i) {
    if (!states[i].done()) return;
    TraceSpan span(check.trace, "hash earlier shard", "shard");
    span.note("shard", shards[i]->name);
    span.note("bytes", states[i].marker->size_bytes);
    states[i] = is_stopped(check) ? ShardState{}
                                  : proven_shard_state(folder, outline_of(*shards[i]), frozen.hash);
  });

  EarlierShards earlier;
  for (std::size_t i = 0; i < shards.size(); ++i) {
    if (states[i].done()) {
      earlier.done.push_back({shards[i], *std::move(states[i].marker)});
      continue;
    }
    earlier.left.push_back(shards[i]);
    if (!states[i].fault.empty()) earlier.faults.push_back(states[i].fault);
    if (states[i].condition == ShardCondition::kOtherBytes) earlier.distrusted[shards[i]->name];
    if (states[i].condition == ShardCondition::kOtherCounts) {
      earlier.distrusted[shards[i]->name] = marker_text(folder, shards[i]->name);
    }
  }
  return earlier;
}

std::int64_t count_quarantined(const std::filesystem::path& folder, const FrozenPlan& frozen,
                               const std::vector<const PlannedShard*>& shards,
                               const EarlierCheck& check) {
  std::atomic<std::int64_t> count = 0;
  for_each_index(shards.size(), check.threads, [&](std::size_t i) {
    if (is_stopped(check)) return;
    const ShardState state = shard_state(folder, outline_of(*shards[i]), frozen.hash);
    if (state.done()) count += std::ssize(state.marker->quarantined);
  });
  return count;
}

}  // namespace eventgan
