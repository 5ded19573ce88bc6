#include "pipeline/finalization/dataset_parts.h"

#include <stdexcept>
#include <utility>

#include "manifests/faults.h"
#include "pipeline/output/shard_states.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

JobManifest frozen_manifest(const fs::path& folder, const PlanOutline& plan) {
  const std::string name = "the manifest in " + (folder / "plan.json").string();
  try {
    return parse_job_manifest(plan.manifest_text, folder, name);
  } catch (const UsageError&) {  // of whoever wrote the plan, not of who finalizes
    std::throw_with_nested(std::runtime_error("expected a plan with a sound manifest"));
  }
}

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw std::runtime_error("expected a shard as its plan and its marker say, got another " + what +
                           ", in " + file.string() + " (eventgan convert makes it again)");
}

/// The header of a shard whose bytes are its marker's.
ShardHeader read_shard_header(const fs::path& folder, const FinishedShard& shard,
                              const std::string& plan_hash) {
  const fs::path file = folder / shard.outline.name;
  ShardHeader header = ShardReader(file).header();
  if (header.name != shard.outline.name) refuse(file, "name");
  if (header.plan_hash != plan_hash) refuse(file, "plan hash");
  if (header.sample_count != shard.outline.samples) refuse(file, "number of samples");
  if (header.volume.size != shard.outline.volume_size && !shard.outline.size_unknown)
    refuse(file, "size of volumes");
  return header;
}

}  // namespace

DatasetParts read_dataset_parts(const fs::path& folder, FrozenOutline frozen,
                                std::vector<ShardState> states, const std::vector<bool>& sound) {
  DatasetParts parts;
  parts.frozen = std::move(frozen);
  parts.manifest = frozen_manifest(folder, parts.frozen.plan);
  parts.amendments = read_amendments(folder, parts.frozen.hash);
  for (std::size_t i = 0; i < states.size(); ++i) {
    const ShardOutline& outline = parts.frozen.plan.shards[i];
    ShardState& state = states[i];
    if (!state.done()) {
      parts.missing.push_back(
          {outline.name, state.fault.empty() ? to_string(state.condition) : state.fault});
      continue;
    }
    parts.shards.push_back({outline, std::move(*state.marker)});
    const bool is_first = !parts.headers.contains(outline.source);
    if (!sound[i] && outline.size_unknown) parts.shards.back().outline.volume_size = {};
    if (!sound[i] || (!is_first && !outline.size_unknown)) continue;
    ShardHeader header = read_shard_header(folder, parts.shards.back(), parts.frozen.hash);
    parts.shards.back().outline.volume_size = header.volume.size;
    if (is_first) parts.headers[outline.source] = std::move(header);
  }
  return parts;
}

DatasetParts read_dataset_parts(const fs::path& folder, FrozenOutline frozen) {
  std::vector<ShardState> states = proven_shard_states(folder, frozen);
  const std::vector<bool> sound(states.size(), true);
  return read_dataset_parts(folder, std::move(frozen), std::move(states), sound);
}

}  // namespace eventgan
