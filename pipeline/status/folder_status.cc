#include "pipeline/status/folder_status.h"

#include <chrono>
#include <map>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "manifests/marker.h"
#include "pipeline/output/output_folder.h"
#include "pipeline/output/shard_states.h"
#include "pipeline/status/worker_rate.h"
#include "pipeline/threads/for_each_index.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A commit is two renames, and a look between them finds a shard without its marker. Whoever is at
/// it is soon through.
constexpr int kLooksAgain = 10;
constexpr std::chrono::milliseconds kBetweenLooks(100);

/// What is kept of a shard's state.
struct ShardView {
  ShardState state;
  double committed_s = 0;  ///< when the marker was written
};

ShardView look_at(const fs::path& folder, const ShardOutline& shard, const std::string& plan_hash) {
  ShardView view{shard_state(folder, shard, plan_hash), 0};
  if (!view.state.done()) return view;
  std::error_code gone;
  const auto time = fs::last_write_time(folder / marker_name(shard.name), gone);
  if (!gone) view.committed_s = std::chrono::duration<double>(time.time_since_epoch()).count();
  // What counts rows is not needed here and large.
  view.state.marker->boxes = {};
  view.state.marker->persons = {};
  return view;
}

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
  Observer(const fs::path& folder, const FrozenOutline& frozen)
      : folder_(folder), frozen_(frozen), views_(frozen.plan.shards.size()) {
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const std::string& name = frozen.plan.shards[i].name;
      shard_of_target_[name] = shard_of_target_[marker_name(name)] = i;
    }
    for (int again = 0; !look() && again < kLooksAgain; ++again) {
      std::this_thread::sleep_for(kBetweenLooks);
    }
  }

  FolderStatus status() const {
    FolderStatus status;
    status.folder = folder_;
    status.plan_hash = frozen_.hash;
    status.shards_planned = static_cast<int>(views_.size());
    status.samples_planned = frozen_.plan.sample_count();
    status.notes = notes_of(frozen_.plan.sources);
    add_files(status);
    std::vector<CommitRecord> commits;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (views_[i].state.done()) {
        add_done(i, status, commits);
      } else if (at_work_.contains(i)) {
        ++status.shards_running;
      } else if (!views_[i].state.fault.empty()) {
        status.damaged.push_back(views_[i].state.fault);
      }
    }
    status.pairs_per_second_of_one = worker_rate(std::move(commits), status.writers);
    return status;
  }

 private:
  /// Looks at the temporaries and every shard that is not done; false if one may be in the middle
  /// of a commit. The temporaries first: what was one then is under its name by now, or still one.
  bool look() {
    files_ = unfinished_files(folder_);
    at_work_.clear();
    for (const UnfinishedFile& file : files_) {
      const auto target = shard_of_target_.find(file.name.target);
      if (target != shard_of_target_.end() && !is_stale(file)) at_work_.insert(target->second);
    }
    for_each_index(views_.size(), kLooksAtOnce, [&](std::size_t i) {
      if (views_[i].state.done()) return;
      views_[i] = look_at(folder_, frozen_.plan.shards[i], frozen_.hash);
    });
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (!views_[i].state.fault.empty() && !at_work_.contains(i)) return false;
    }
    return true;
  }

  void add_files(FolderStatus& status) const {
    std::set<std::pair<std::string, pid_t>> writers;
    for (const UnfinishedFile& file : files_) {
      const auto target = shard_of_target_.find(file.name.target);
      if (is_stale(file)) {
        status.left_over.push_back(file);
      } else if (target != shard_of_target_.end()) {
        add_running(status.running, {frozen_.plan.shards[target->second].name, file});
        writers.emplace(file.name.host, file.name.pid);
      }
    }
    status.writers = static_cast<int>(writers.size());
  }

  void add_done(std::size_t i, FolderStatus& status, std::vector<CommitRecord>& commits) const {
    const ShardMarker& marker = *views_[i].state.marker;
    ++status.shards_done;
    status.samples_written += marker.valid;
    for (const QuarantinedSample& sample : marker.quarantined) {
      status.quarantined.push_back({marker.shard, sample.slot, sample.sample_id, sample.reason});
    }
    commits.push_back({views_[i].committed_s, marker.samples, marker.wall_seconds});
  }

  const fs::path& folder_;
  const FrozenOutline& frozen_;
  std::map<std::string, std::size_t> shard_of_target_;  // by the names of shards and markers
  std::vector<ShardView> views_;
  std::vector<UnfinishedFile> files_;
  std::set<std::size_t> at_work_;
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

}  // namespace eventgan
