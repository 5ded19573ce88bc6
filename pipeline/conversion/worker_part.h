#pragma once

#include <functional>
#include <optional>
#include <string>

namespace eventgan {

/// The part of a plan's shards that one worker does: shard s belongs to part s mod count.
struct WorkerPart {
  int index = 0;
  int count = 1;       ///< 0: as many parts as the plan has shards, so `index` is a shard's number
  std::string origin;  ///< what said so: "--shards", "SLURM_ARRAY_TASK_ID", ...; empty: all shards
  bool operator==(const WorkerPart&) const = default;

  /// Whether a shard is in it, by its place in the plan; a part may be beyond the plan's shards.
  bool has(int shard) const { return count > 0 ? shard % count == index : shard == index; }
};

/// The part this process is asked to do. The first of these that is there decides:
/// - `flag`: "I/N" with 0 <= I < N, or "all";
/// - SHARD_INDEX, SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX, with SHARD_COUNT as the number of
///   parts or, without it, the plan's number of shards (never the array's size, which a retry of
///   some tasks shrinks);
/// - OMPI_COMM_WORLD_RANK of OMPI_COMM_WORLD_SIZE;
/// - SLURM_PROCID of SLURM_STEP_NUM_TASKS. Slurm sets the former (to 0) for a batch script as well,
///   the latter only for the tasks that srun starts: without it the process is no task of many;
/// - nothing of all that: all shards.
///
/// `environment` is getenv. Throws UsageError naming the flag or variable that is no such number,
/// and for SHARD_COUNT without an index: each of many workers would do everything.
WorkerPart choose_part(const std::optional<std::string>& flag,
                       const std::function<const char*(const char*)>& environment);

/// For a person: "part 3 of 7 (--shards)", "shard 3 of 1024 (SLURM_ARRAY_TASK_ID)", "all shards".
/// Parts and shards are counted from 0, as in their names.
std::string to_text(const WorkerPart& part, int shard_count);

}  // namespace eventgan
