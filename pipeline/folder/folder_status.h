#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/files/unfinished_files.h"
#include "manifests/values/shard.h"

namespace eventgan {

/// A shard under way.
struct ShardAtWork {
  std::string shard;    ///< its file name
  UnfinishedFile file;  ///< the shard's temporary, or its commit record's
};

/// What is in an output folder.
struct FolderStatus {
  std::filesystem::path folder;
  std::string plan_hash;
  int shards_planned = 0;
  int shards_done = 0;
  int shards_running = 0;  ///< not done, and someone who seems alive is writing them
  std::int64_t samples_planned = 0;
  std::int64_t samples_written = 0;       ///< valid ones of committed shards
  std::int64_t samples_under_way = 0;     ///< of the shards that are running, as their writers tell
  std::vector<ShardAtWork> running;       ///< an entry a writer; a shard can have two
  std::vector<UnfinishedFile> left_over;  ///< temporaries of dead writers
  std::vector<std::string> damaged;       ///< a line for each shard that is there and not done
  std::vector<QuarantinedSlot> quarantined;
  std::vector<std::string> notes;  ///< on the inputs (see notes_of)
  int writers = 0;                 ///< processes at work
  /// Of one worker, from the last commits; none before the first.
  std::optional<double> pairs_per_second_of_one;

  bool complete() const { return shards_done == shards_planned; }
  /// Those that are damaged included.
  int shards_missing() const { return shards_planned - shards_done - shards_running; }
  /// Of all writers; 0 if nobody is at work, none if unknown.
  std::optional<double> pairs_per_second() const;
  /// At this rate; none if unknown or nobody is at work.
  std::optional<double> seconds_left() const;
};

/// Looks at an output folder, by its files alone: from any machine, while others write to it. Whole
/// shards are not read; see verify_folder for that. Throws InputError if there is no plan.
FolderStatus folder_status(const std::filesystem::path& folder);

/// What a commit record tells about the speed of the worker that committed it.
struct CommitTiming {
  double time_s = 0;  ///< when, from any fixed point in time
  int samples = 0;
  double wall_seconds = 0;  ///< that the worker spent on the shard; 0 if unknown
};

/// Samples a second of one worker, as of late: the median over the last commits, a few for each of
/// `writers` workers, so that neither one that was paused for a night nor a slow beginning counts.
/// None if no timing knows its time.
std::optional<double> worker_rate(std::vector<CommitTiming> timings, int writers);

/// What is wrong with a sample, without where: the reason's first line up to ", in PATH", by which
/// the samples of a damaged disk or a wrong folder fall together.
std::string fault_kind(const std::string& reason);

/// What `eventgan status` prints: a few lines of numbers, then who is at work, what dead writers
/// left, what is damaged, and why samples are quarantined; long lists are cut short.
std::string status_text(const FolderStatus& status);

/// The same as JSON, with every entry; null where a number is unknown.
std::string status_json(const FolderStatus& status);

}  // namespace eventgan
