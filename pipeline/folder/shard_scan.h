#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/shard.h"
#include "pipeline/runtime/progress.h"
#include "pipeline/runtime/trace.h"

namespace eventgan {

/// What an output folder holds of a planned shard.
enum class ShardCondition {
  kDone,           ///< the commit record parses, is of this plan, and the shard has its size
  kMissing,        ///< neither shard nor commit record
  kUncommitted,    ///< a shard without a commit record: its writer ended between the two
  kNoShard,        ///< a commit record without a shard
  kDamagedRecord,  ///< the commit record does not parse
  kForeignRecord,  ///< the commit record is of another plan or another shard
  kOtherSize,      ///< the shard has not the commit record's size
  kOtherBytes,     ///< the shard has not the commit record's SHA-256
  kOtherCounts     ///< the rows are not what the commit record says
};

/// Short words for a person: "done", "missing", "not committed", ...
const char* to_string(ShardCondition condition);

/// A planned shard as it is in an output folder.
struct ShardState {
  ShardOutline outline;
  ShardCondition condition = ShardCondition::kMissing;
  std::optional<CommitRecord> record{};         ///< kDone: the shard's
  std::filesystem::file_time_type committed{};  ///< kDone: of the commit record, if known
  std::string named_plan{};  ///< hash of the plan that the commit record names; empty: none
  /// "PATH: expected X, got Y". None for kMissing; for kDone only after ScanDepth::kContents; else
  /// one.
  std::vector<std::string> faults{};

  bool done() const { return condition == ShardCondition::kDone; }
  /// At the depth that was asked for.
  bool sound() const { return done() && faults.empty(); }
};

/// How far a look at a shard goes; each goes on where the one before has found the shard done.
/// HDF5 opens a shard only if its bytes are the commit record's: it does not promise to survive
/// others.
enum class ScanDepth {
  kRecord,   ///< names, sizes and the commit record alone: what says "done"
  kBytes,    ///< and the shard is hashed: may find kOtherBytes
  kRows,     ///< and what the commit record says of the rows is compared: may find kOtherCounts
  kContents  ///< as kRecord, and then all that check_shard finds: faults of a shard that is done
};

/// Looks at one shard of the plan with hash `plan_hash`. Never throws for what is in the
/// folder. Thread safe; with kRows and kContents nothing else may use HDF5 meanwhile but this and
/// ShardReaders.
ShardState shard_state(const std::filesystem::path& folder, const ShardOutline& shard,
                       const std::string& plan_hash, ScanDepth depth = ScanDepth::kRecord);

struct ScanOptions {
  /// Shards to look at side by side. 0: all cores, or with kRecord, where on a network file system
  /// each look is a few waits, as many as fit.
  int threads = 0;
  /// Asked before each shard, from several threads: true leaves it out, as if it were missing.
  std::function<bool()> stop{};
  TraceRecorder* trace = nullptr;  ///< of shards that are read; null: nobody asks
  ShowPhase show_phase{};
};

/// What a person should know of the inputs of a plan and of those `shards` of it that are done; and
/// what their files have that this program does not know, of a later minor version.
std::vector<std::string> notes_of(const PlanOutline& plan, const std::vector<ShardState>& shards);

/// What the folder holds of each of `shards`, in their order.
std::vector<ShardState> scan_shards(const std::filesystem::path& folder,
                                    const std::vector<ShardOutline>& shards,
                                    const std::string& plan_hash,
                                    ScanDepth depth = ScanDepth::kRecord,
                                    const ScanOptions& options = {});

/// Looks again, at those of an earlier scan that are done, or at those that are not.
void scan_again(const std::filesystem::path& folder, const std::string& plan_hash, bool done,
                std::vector<ShardState>& states, ScanDepth depth = ScanDepth::kRecord,
                const ScanOptions& options = {});

/// The names of classes that each of the manifest's `sources` sources has in its shards: of the
/// first that is whole; none where none is.
std::vector<std::optional<std::vector<std::string>>> stored_classes(
    const std::filesystem::path& folder, const std::vector<ShardOutline>& shards,
    const std::string& plan_hash, std::size_t sources);

}  // namespace eventgan
