#include "pipeline/folder/folder_status.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "manifests/marker.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A commit is two renames, and a look between them finds a shard without its marker. Whoever is at
/// it is soon through.
constexpr int kLooksAgain = 10;
constexpr std::chrono::milliseconds kBetweenLooks(100);

/// A worker can have several temporaries for one shard: its claim, the shard, its marker. The one
/// written last tells how it goes.
void add_running(std::vector<ShardAtWork>& running, ShardAtWork work) {
  for (ShardAtWork& known : running) {
    const bool same = known.shard == work.shard && known.file.name.host == work.file.name.host &&
                      known.file.name.pid == work.file.name.pid;
    if (!same) continue;
    if (work.file.silent_s < known.file.silent_s) known = std::move(work);
    return;
  }
  running.push_back(std::move(work));
}

/// A folder being written to.
class Observer {
 public:
  Observer(const fs::path& folder, const FrozenOutline& frozen) : folder_(folder), frozen_(frozen) {
    for (const ShardOutline& shard : frozen.plan.shards) {
      shard_of_target_[shard.name] = shard_of_target_[marker_name(shard.name)] = shard.name;
    }
    look_at_temporaries();
    shards_ = scan_shards(folder_, frozen_.plan.shards, frozen_.hash);
    for (int again = 0; may_be_committing() && again < kLooksAgain; ++again) {
      std::this_thread::sleep_for(kBetweenLooks);
      look_at_temporaries();
      scan_again(folder_, frozen_.hash, /*done=*/false, shards_);
    }
  }

  FolderStatus status() const {
    FolderStatus status;
    status.folder = folder_;
    status.plan_hash = frozen_.hash;
    status.shards_planned = static_cast<int>(shards_.size());
    status.samples_planned = frozen_.plan.sample_count();
    status.notes = notes_of(frozen_.plan.sources);
    add_files(status);
    std::vector<CommitRecord> commits;
    for (const ShardState& shard : shards_) {
      if (shard.done()) {
        add_done(shard, status, commits);
      } else if (at_work_.contains(shard.outline.name)) {
        ++status.shards_running;
      } else {
        status.damaged.insert(status.damaged.end(), shard.faults.begin(), shard.faults.end());
      }
    }
    status.pairs_per_second_of_one = worker_rate(std::move(commits), status.writers);
    return status;
  }

 private:
  /// Before each look at the shards: what was a temporary then is under its name by now, or still
  /// one.
  void look_at_temporaries() {
    files_ = unfinished_files(folder_);
    at_work_.clear();
    for (const UnfinishedFile& file : files_) {
      const auto target = shard_of_target_.find(file.name.target);
      if (target != shard_of_target_.end() && !is_stale(file)) at_work_.insert(target->second);
    }
  }

  bool may_be_committing() const {
    return std::ranges::any_of(shards_, [&](const ShardState& shard) {
      return !shard.faults.empty() && !at_work_.contains(shard.outline.name);
    });
  }

  void add_files(FolderStatus& status) const {
    std::set<std::pair<std::string, pid_t>> writers;
    for (const UnfinishedFile& file : files_) {
      const auto target = shard_of_target_.find(file.name.target);
      if (is_stale(file)) {
        status.left_over.push_back(file);
      } else if (target != shard_of_target_.end()) {
        add_running(status.running, {target->second, file});
        writers.emplace(file.name.host, file.name.pid);
      }
    }
    status.writers = static_cast<int>(writers.size());
  }

  static void add_done(const ShardState& shard, FolderStatus& status,
                       std::vector<CommitRecord>& commits) {
    const ShardMarker& marker = *shard.marker;
    ++status.shards_done;
    status.samples_written += marker.valid;
    for (const QuarantinedSample& sample : marker.quarantined) {
      status.quarantined.push_back({marker.shard, sample.slot, sample.sample_id, sample.reason});
    }
    const double committed_s =
        std::chrono::duration<double>(shard.committed.time_since_epoch()).count();
    commits.push_back({committed_s, marker.samples, marker.wall_seconds});
  }

  const fs::path& folder_;
  const FrozenOutline& frozen_;
  std::map<std::string, std::string> shard_of_target_;  // by the names of shards and markers
  std::vector<ShardState> shards_;
  std::vector<UnfinishedFile> files_;
  std::set<std::string> at_work_;  // shards
};

}  // namespace

std::optional<double> FolderStatus::pairs_per_second() const {
  if (writers == 0) return 0.0;
  return pairs_per_second_of_one ? std::optional(writers * *pairs_per_second_of_one) : std::nullopt;
}

std::optional<double> FolderStatus::seconds_left() const {
  if (complete()) return 0.0;
  const std::optional<double> rate = pairs_per_second();
  if (!rate || !(*rate > 0)) return std::nullopt;
  const auto left =
      samples_planned - samples_written - static_cast<std::int64_t>(quarantined.size());
  return static_cast<double>(left) / *rate;
}

FolderStatus folder_status(const fs::path& folder) {
  const FrozenOutline frozen = read_frozen_outline(folder);
  return Observer(folder, frozen).status();
}

std::optional<double> worker_rate(std::vector<CommitRecord> records, int writers) {
  constexpr std::size_t kFewest = 8;
  constexpr std::size_t kOfEachWriter = 3;
  std::erase_if(records, [](const CommitRecord& record) {
    return record.samples <= 0 || !(record.wall_seconds > 0);
  });
  if (records.empty()) return std::nullopt;
  const auto wanted = std::max(kFewest, kOfEachWriter * static_cast<std::size_t>(writers));
  const auto last = static_cast<std::ptrdiff_t>(std::min(records.size(), wanted));
  std::partial_sort(records.begin(), records.begin() + last, records.end(),
                    [](const auto& one, const auto& other) { return one.time_s > other.time_s; });
  std::vector<double> rates;
  for (auto record = records.begin(); record != records.begin() + last; ++record) {
    rates.push_back(record->samples / record->wall_seconds);
  }
  std::sort(rates.begin(), rates.end());
  const std::size_t middle = rates.size() / 2;
  return rates.size() % 2 == 1 ? rates[middle] : (rates[middle - 1] + rates[middle]) / 2;
}

std::string fault_kind(const std::string& reason) {
  return reason.substr(0, std::min(reason.find(", in "), reason.find('\n')));
}

}  // namespace eventgan
