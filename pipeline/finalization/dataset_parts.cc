#include "pipeline/finalization/dataset_parts.h"

#include <stdexcept>
#include <utility>

#include "manifests/faults.h"
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
ShardHeader read_shard_header(const fs::path& folder, const ShardState& shard,
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
                                std::vector<ShardState> shards) {
  DatasetParts parts;
  parts.frozen = std::move(frozen);
  parts.manifest = frozen_manifest(folder, parts.frozen.plan);
  parts.amendments = read_amendments(folder, parts.frozen.hash);
  for (ShardState& shard : shards) {
    if (!shard.done()) {
      parts.missing.push_back(std::move(shard));
      continue;
    }
    ShardOutline& outline = shard.outline;
    const bool is_first = !parts.headers.contains(outline.source);
    if (shard.sound() && (is_first || outline.size_unknown)) {
      ShardHeader header = read_shard_header(folder, shard, parts.frozen.hash);
      outline.volume_size = header.volume.size;
      if (is_first) parts.headers[outline.source] = std::move(header);
    } else if (!shard.sound() && outline.size_unknown) {
      outline.volume_size = {};
    }
    parts.done.push_back(std::move(shard));
  }
  return parts;
}

}  // namespace eventgan
