#include "pipeline/folder/shard_backup.h"

#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "manifests/documents/commit_record.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "manifests/files/unfinished_files.h"
#include "pipeline/folder/shard_scan.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Whether the commit record in place is of this plan, and of just these bytes.
bool is_of_commit_record(const fs::path& file, const fs::path& commit_record_file,
                         const std::string& plan_hash) {
  try {
    const CommitRecord record =
        parse_commit_record(read_text_file(commit_record_file), commit_record_file.string());
    return record.plan_hash == plan_hash &&
           static_cast<std::int64_t>(fs::file_size(file)) == record.size_bytes &&
           sha256_of_file(file) == record.sha256;
  } catch (const std::runtime_error&) {
    return false;
  }
}

/// Names of the files that someone who seems alive is writing.
std::set<std::string> targets_at_work(const std::vector<UnfinishedFile>& files) {
  std::set<std::string> targets;
  for (const UnfinishedFile& file : files) {
    if (!is_stale(file)) targets.insert(file.name.target);
  }
  return targets;
}

void put_back(const fs::path& backup, const fs::path& shard) {
  try {
    publish(backup, shard);
  } catch (const std::runtime_error&) {
    if (fs::exists(backup)) throw;  // else another process that starts now was faster
  }
}

}  // namespace

ShardBackup::ShardBackup(const fs::path& shard) : shard_(shard), backup_(temporary_beside(shard)) {
  std::error_code unsupported;
  fs::create_hard_link(shard_, backup_, unsupported);
  if (unsupported) {
    backup_.clear();
    return;
  }
  // A temporary's time says that its writer lives; the shard's own may be long ago.
  std::error_code ignored;
  fs::last_write_time(backup_, fs::file_time_type::clock::now(), ignored);
}

ShardBackup::~ShardBackup() {
  if (backup_.empty()) return;
  // Where the shard was not replaced, both names are one file, and renaming does nothing.
  std::error_code ignored;
  fs::rename(backup_, shard_, ignored);
  fs::remove(backup_, ignored);
}

void ShardBackup::release() {
  std::error_code ignored;  // the next run cleans up
  if (!backup_.empty()) fs::remove(backup_, ignored);
  backup_.clear();
}

void restore_shards(const fs::path& folder, const FrozenOutline& frozen) {
  std::map<std::string, const ShardOutline*> shards;
  for (const ShardOutline& shard : frozen.plan.shards) shards[shard.name] = &shard;
  const std::vector<UnfinishedFile> files = unfinished_files(folder);
  const std::set<std::string> at_work = targets_at_work(files);
  for (const UnfinishedFile& file : files) {
    const auto shard = shards.find(file.name.target);
    // Whoever is at a shard may publish it at any moment; that counts, with its own commit record.
    if (shard == shards.end() || !is_stale(file) || at_work.contains(shard->first)) continue;
    // What most dead writers leave is not whole, which its size tells: nothing is hashed.
    if (is_of_commit_record(file.path, folder / commit_record_name(shard->first), frozen.hash) &&
        !shard_state(folder, *shard->second, frozen.hash, ScanDepth::kBytes).done()) {
      put_back(file.path, folder / shard->first);
    }
  }
  remove_stale_temporaries(folder);
}

}  // namespace eventgan
