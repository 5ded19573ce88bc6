#include "pipeline/dataset/shown_samples.h"

#include <charconv>
#include <optional>
#include <set>

#include "manifests/values/faults.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_guard.h"
#include "pipeline/folder/shard_scan.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {

namespace fs = std::filesystem;

bool means_folder(const fs::path& where) {
  std::error_code unknown;
  return fs::is_directory(where, unknown) || where.filename() == kViewName;
}

fs::path folder_of_shards(const fs::path& where) {
  std::error_code unknown;
  return fs::is_directory(where, unknown) ? where : fs::absolute(where).parent_path();
}

ShownShards find_shown_shards(const fs::path& where) {
  lift_time_limit();  // plan and commit records of a large job take long, and are no HDF5
  ShownShards shards;
  shards.folder = folder_of_shards(where);
  shards.is_folder = means_folder(where);
  if (!shards.is_folder) {
    renew_time_limit();
    shards.samples.push_back(ShardReader(where).header().sample_count);
    lift_time_limit();
    shards.files.push_back(where);
    shards.sources.push_back(0);
    return shards;
  }
  const FrozenOutline frozen = read_frozen_outline(shards.folder);
  for (const ShardState& shard : scan_shards(shards.folder, frozen.plan.shards, frozen.hash)) {
    if (!shard.done()) continue;
    shards.files.push_back(shards.folder / shard.outline.name);
    shards.samples.push_back(shard.outline.samples);
    shards.sources.push_back(shard.outline.source);
  }
  if (shards.files.empty()) {
    throw InputError("expected finished shards, got none, in " + shards.folder.string());
  }
  return shards;
}

namespace {

/// The slot that a name spells as a program would; none if it is no number, or has leading zeros.
std::optional<int> slot_of(const std::string& name) {
  int slot = -1;
  const char* const end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data(), end, slot);
  if (error != std::errc() || stop != end || slot < 0 || std::to_string(slot) != name) {
    return std::nullopt;
  }
  return slot;
}

}  // namespace

std::vector<ShownSample> find_samples(const ShownShards& shards,
                                      const std::vector<std::string>& names) {
  const std::set<std::string> wanted(names.begin(), names.end());
  std::set<std::string> no_ids = wanted;
  std::set<ShownSample> found;
  for (std::size_t i = 0; i < shards.files.size(); ++i) {
    renew_time_limit();
    const ShardOverview overview = read_overview(shards.files[i]);
    lift_time_limit();
    const std::vector<std::string>& ids = overview.tables.pairs.sample_id;
    for (std::size_t slot = 0; slot < ids.size(); ++slot) {
      if (!wanted.contains(ids[slot])) continue;
      no_ids.erase(ids[slot]);
      found.insert({i, static_cast<int>(slot)});
    }
  }
  for (const std::string& name : no_ids) {
    const std::optional<int> slot = slot_of(name);
    if (!shards.is_folder && slot && *slot < shards.samples[0]) {
      found.insert({0, *slot});
      continue;
    }
    if (shards.is_folder) {
      throw UsageError("--sample: expected the id of a sample, got \"" + name + "\", in " +
                       shards.folder.string() + " (slots need a single shard)");
    }
    throw UsageError("--sample: expected the id of a sample, or a slot in 0.." +
                     std::to_string(shards.samples[0] - 1) + ", got \"" + name + "\", in " +
                     shards.files[0].string());
  }
  return {found.begin(), found.end()};
}

}  // namespace eventgan
