#include "pipeline/inspection/verify_folder.h"

#include <fstream>
#include <iterator>
#include <set>

#include "pipeline/errors/error_text.h"
#include "pipeline/output/output_folder.h"
#include "stages/shards/shard_check.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

void check_planned(const fs::path& folder, const PlannedShard& shard, const std::string& plan_hash,
                   FolderCheck& check) {
  const fs::path file = folder / shard.name;
  const fs::path marker_file = folder / marker_name(shard.name);
  std::ifstream stream(marker_file, std::ios::binary);
  if (!stream) {
    check.faults.push_back(marker_file.string() + ": expected the shard's marker, got no file" +
                           (fs::exists(file) ? " (the shard is there: not committed)" : ""));
    return;
  }
  try {
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    const ShardMarker marker = parse_marker(text, marker_file.string());
    if (marker.shard != shard.name || marker.plan_hash != plan_hash ||
        marker.samples != static_cast<int>(shard.samples.size())) {
      check.faults.push_back(marker_file.string() + ": expected the marker of " + shard.name +
                             " by this plan, got another one");
      return;
    }
    check.samples += marker.samples;
    check.valid += marker.valid;
    const auto faults = check_shard(file, marker);
    check.faults.insert(check.faults.end(), faults.begin(), faults.end());
  } catch (const std::runtime_error& error) {
    check.faults.push_back(error_text(error));
  }
}

}  // namespace

FolderCheck verify_folder(const fs::path& folder) {
  const FrozenPlan frozen = read_frozen_plan(folder);
  FolderCheck check;
  std::set<std::string> planned;
  for (const PlannedShard& shard : frozen.plan.shards) {
    planned.insert(shard.name);
    ++check.shards;
    check_planned(folder, shard, frozen.hash, check);
  }
  std::set<std::string> strangers;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".h5" && planned.count(name) == 0) strangers.insert(name);
  }
  for (const std::string& name : strangers) {
    check.faults.push_back((folder / name).string() +
                           ": expected shards of the plan only, got another file");
  }
  return check;
}

}  // namespace eventgan
