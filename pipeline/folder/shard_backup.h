#pragma once

#include <filesystem>

#include "pipeline/folder/output_folder.h"

namespace eventgan {

/// A committed shard as it is, kept while another is put in its place: shard and commit record are
/// two files, and cannot be replaced at once. It is a second name (a hard link, a temporary's) for
/// the same file, so it costs nothing; where the file system has no such links nothing is kept, and
/// what ends between the two leaves a shard that is not its commit record's, for `convert` to make
/// again.
class ShardBackup {
 public:
  explicit ShardBackup(const std::filesystem::path& shard);

  /// Puts the shard back, unless released.
  ~ShardBackup();
  ShardBackup(const ShardBackup&) = delete;
  ShardBackup& operator=(const ShardBackup&) = delete;

  /// The shard in its place is the one that counts now.
  void release();

 private:
  std::filesystem::path shard_;
  std::filesystem::path backup_;  // empty: none
};

/// Puts back the shards whose replacement was killed between shard and commit record: those that
/// are not their commit record's while a dead writer (see is_stale) has left a file that is, and
/// nobody alive is at them. Then deletes the leftover temporaries of dead writers. Safe in several
/// processes at once. Throws std::runtime_error naming the path if the disk fails.
void restore_shards(const std::filesystem::path& folder, const FrozenOutline& frozen);

}  // namespace eventgan
