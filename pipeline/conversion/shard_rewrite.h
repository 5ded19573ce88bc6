#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/shard.h"
#include "pipeline/conversion/sample_stages.h"
#include "stages/shards/shard_reader.h"
#include "stages/shards/shard_writer.h"

namespace eventgan {

/// Writes a committed shard again with some of its quarantined samples redone. Everything else is
/// copied, rows as they are and volumes chunk by chunk, without being decoded: redoing a good
/// sample would lose it if its inputs are gone. The file is begun only when a redone sample proves
/// different: of a shard whose samples all fail as they did before, nothing is touched. One that is
/// not committed leaves the shard as it was. Thread safety: one thread at a time.
class ShardRewrite {
 public:
  /// `record` is that of the shard in `folder`, whose bytes are known to be the commit record's.
  /// `volume_size`: what its volumes get instead of their size; only of a shard without a good
  /// sample, and so without volumes. `class_names`: what its classes get; of others than it has the
  /// shard is written in any case. Throws InputError if they do not begin with those it has, whose
  /// numbers stay, and as ShardReader does.
  ShardRewrite(std::filesystem::path folder, CommitRecord record,
               std::optional<ImageSize> volume_size = std::nullopt,
               const std::optional<std::vector<std::string>>& class_names = std::nullopt);

  /// A sample redone, good or failed again; slots ascend. Throws std::runtime_error if the disk
  /// fails.
  void redo(int slot, const SampleMessage& message);

  /// Copies the rest, publishes the shard and then its commit record; does nothing, and gives
  /// false, if nothing differs. Throws std::runtime_error if another process has put another shard
  /// in its place meanwhile, or the disk fails. Between the two names the folder holds a shard that
  /// is not its commit record's: an error just there puts the shard back, after a kill
  /// restore_shards does. Once.
  bool commit();

  /// Of the samples that were redone and are good.
  const InputCounts& mended() const { return mended_; }

 private:
  void name_classes(const std::vector<std::string>& class_names);
  bool is_news(int slot, const ShardSample& sample) const;
  void copy_before(int slot);
  void append(const ShardSample& sample, std::span<const std::byte> chunk);

  std::filesystem::path folder_;
  CommitRecord before_;
  ShardReader reader_;
  ShardHeader header_;                   // of what is written
  std::unique_ptr<ShardWriter> writer_;  // from the first difference on
  CommitRecord record_;                  // of what is written
  InputCounts mended_;
};

}  // namespace eventgan
