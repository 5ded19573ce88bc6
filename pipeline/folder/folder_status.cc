#include "pipeline/folder/folder_status.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/plan.h"
#include "manifests/documents/report.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"
#include "pipeline/runtime/progress.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A commit is two renames, and a look between them finds a shard without its commit record.
/// Whoever is at it is soon through.
constexpr int kLooksAgain = 10;
constexpr std::chrono::milliseconds kBetweenLooks(100);

/// A worker can have several temporaries for one shard: its claim, the shard, its commit record.
/// The one written last tells how it goes.
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

/// How many samples of a shard are written, where the temporary is a claim that says so (see
/// SharedFolder); else 0.
int samples_told(const UnfinishedFile& file) {
  std::array<char, 10> text{};
  std::ifstream stream(file.path, std::ios::binary);
  stream.read(text.data(), text.size());
  int samples = 0;
  const char* const end = text.data() + stream.gcount();
  const auto [stop, error] = std::from_chars(text.data(), end, samples);
  return error == std::errc() && stop == end && samples > 0 ? samples : 0;
}

/// A folder being written to.
class Observer {
 public:
  Observer(const fs::path& folder, const FrozenOutline& frozen) : folder_(folder), frozen_(frozen) {
    for (const ShardOutline& shard : frozen.plan.shards) {
      shard_of_target_[shard.name] = shard_of_target_[commit_record_name(shard.name)] = shard.name;
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
    status.notes = notes_of(frozen_.plan, shards_);
    add_files(status);
    std::vector<CommitTiming> commits;
    for (const ShardState& shard : shards_) {
      if (shard.done()) {
        add_done(shard, status, commits);
      } else if (at_work_.contains(shard.outline.name)) {
        ++status.shards_running;
        status.samples_under_way +=
            std::min(at_work_.at(shard.outline.name), shard.outline.samples);
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
      if (target == shard_of_target_.end() || is_stale(file)) continue;
      int& samples = at_work_[target->second];
      samples = std::max(samples, samples_told(file));
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
                       std::vector<CommitTiming>& commits) {
    const CommitRecord& record = *shard.record;
    ++status.shards_done;
    status.samples_written += record.valid;
    for (const QuarantinedSample& sample : record.quarantined) {
      status.quarantined.push_back({record.shard, sample.slot, sample.sample_id, sample.reason});
    }
    const double committed_s =
        std::chrono::duration<double>(shard.committed.time_since_epoch()).count();
    commits.push_back({committed_s, record.samples, record.wall_seconds});
  }

  const fs::path& folder_;
  const FrozenOutline& frozen_;
  std::map<std::string, std::string> shard_of_target_;  // by the names of shards and commit records
  std::vector<ShardState> shards_;
  std::vector<UnfinishedFile> files_;
  std::map<std::string, int> at_work_;  // shards, with their samples so far
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
  const auto left = samples_planned - samples_written - samples_under_way -
                    static_cast<std::int64_t>(quarantined.size());
  return static_cast<double>(left) / *rate;
}

FolderStatus folder_status(const fs::path& folder) {
  const FrozenOutline frozen = read_frozen_outline(folder);
  return Observer(folder, frozen).status();
}

std::optional<double> worker_rate(std::vector<CommitTiming> timings, int writers) {
  constexpr std::size_t kFewest = 8;
  constexpr std::size_t kOfEachWriter = 3;
  std::erase_if(timings, [](const CommitTiming& timing) {
    return timing.samples <= 0 || !(timing.wall_seconds > 0);
  });
  if (timings.empty()) return std::nullopt;
  const auto wanted = std::max(kFewest, kOfEachWriter * static_cast<std::size_t>(writers));
  const auto last = static_cast<std::ptrdiff_t>(std::min(timings.size(), wanted));
  std::partial_sort(timings.begin(), timings.begin() + last, timings.end(),
                    [](const auto& one, const auto& other) { return one.time_s > other.time_s; });
  std::vector<double> rates;
  for (auto timing = timings.begin(); timing != timings.begin() + last; ++timing) {
    rates.push_back(timing->samples / timing->wall_seconds);
  }
  std::sort(rates.begin(), rates.end());
  const std::size_t middle = rates.size() / 2;
  return rates.size() % 2 == 1 ? rates[middle] : (rates[middle - 1] + rates[middle]) / 2;
}

std::string fault_kind(const std::string& reason) {
  return reason.substr(0, std::min(reason.find(", in "), reason.find('\n')));
}

namespace {

/// Lists for a person end here; --json has everything.
constexpr std::size_t kListed = 20;

using Cells = std::vector<std::string>;

/// A title, and a row of cells for each item, the columns aligned, each row indented; cut after
/// kListed rows. Nothing where there is no item.
template <class Items, class CellsOf>
std::string section(const std::string& title, const Items& items, const CellsOf& cells_of) {
  std::vector<Cells> rows;
  std::vector<std::size_t> widths;
  for (const auto& item : items) {
    if (rows.size() == kListed) break;
    Cells& row = rows.emplace_back(cells_of(item));
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t j = 0; j < row.size(); ++j) {
      row[j] = escape_controls(row[j]);
      widths[j] = std::max(widths[j], row[j].size());
    }
  }
  std::string text = title + "\n";
  for (const Cells& row : rows) {
    text += "  ";
    for (std::size_t j = 0; j + 1 < row.size(); ++j) {
      text += row[j] + std::string(widths[j] - row[j].size() + 2, ' ');
    }
    text += row.back() + "\n";
  }
  if (items.size() > rows.size()) {
    text += fmt::format("  ... and {} more (--json lists them)\n", items.size() - rows.size());
  }
  return text;
}

std::string age_text(const UnfinishedFile& file) {
  const std::string span = duration_text(std::abs(file.silent_s), "dhms");
  return file.silent_s < 0 ? "dated " + span + " ahead" : "last wrote " + span + " ago";
}

/// A row a reason, the commonest first, with one of its samples.
std::vector<Cells> reason_rows(const FolderStatus& status) {
  std::map<std::string, std::vector<const QuarantinedSlot*>> by_kind;
  for (const QuarantinedSlot& sample : status.quarantined) {
    by_kind[fault_kind(sample.reason)].push_back(&sample);
  }
  std::vector<std::pair<std::string, std::vector<const QuarantinedSlot*>>> kinds(by_kind.begin(),
                                                                                 by_kind.end());
  std::stable_sort(kinds.begin(), kinds.end(), [](const auto& one, const auto& other) {
    return one.second.size() > other.second.size();
  });
  std::vector<Cells> rows;
  for (const auto& [kind, samples] : kinds) {
    const QuarantinedSlot& first = *samples.front();
    rows.push_back({std::to_string(samples.size()),
                    fmt::format("{} ({}{}, {} slot {})", kind, samples.size() == 1 ? "" : "first: ",
                                first.sample_id, first.shard, first.slot)});
  }
  return rows;
}

std::string shards_text(const FolderStatus& status) {
  const std::string text =
      fmt::format("{} of {} done, {} running, {} missing", status.shards_done,
                  status.shards_planned, status.shards_running, status.shards_missing());
  if (status.damaged.empty()) return text;
  return text + fmt::format(" ({} of them damaged)", status.damaged.size());
}

std::string work_text(const FolderStatus& status) {
  const std::string at_work =
      status.writers == 0 ? "no process is running"
                          : fmt::format("{} {} running", status.writers,
                                        status.writers == 1 ? "process is" : "processes are");
  if (status.complete()) return at_work + ", and every shard is done";
  if (status.writers == 0) return at_work + "; eventgan convert resumes from here";
  const auto rate = status.pairs_per_second();
  const auto left = status.seconds_left();
  if (!rate || !left) return at_work + ", speed known after the first shard";
  return fmt::format("{}, {:.3g} pairs/s, about {} left", at_work, *rate,
                     duration_text(*left, "dhms"));
}

/// Written, quarantined and these together are what the bar of one worker counts.
std::string under_way_text(const FolderStatus& status) {
  return status.shards_running == 0
             ? ""
             : fmt::format("{} more in unfinished shards, ", status.samples_under_way);
}

nlohmann::json number(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json();
}

nlohmann::json writer_json(const UnfinishedFile& file, const char* key, const std::string& name) {
  return {{key, name},
          {"host", file.name.host},
          {"pid", file.name.pid},
          {"silent_s", file.silent_s},
          {"writer", to_string(file.writer)}};
}

Report table_of(const FolderStatus& status) {
  std::map<std::string, int> reasons;
  for (const QuarantinedSlot& sample : status.quarantined) ++reasons[fault_kind(sample.reason)];
  const std::string folder = status.folder.string();
  return {{"folder", folder, "folder   " + folder},
          {"plan_hash", status.plan_hash, fmt::format("plan     {:.16}", status.plan_hash)},
          {"complete", status.complete()},
          {"shards",
           {{"planned", status.shards_planned},
            {"done", status.shards_done},
            {"running", status.shards_running},
            {"missing", status.shards_missing()}},
           "shards   " + shards_text(status)},
          {"samples",
           {{"planned", status.samples_planned},
            {"written", status.samples_written},
            {"under_way", status.samples_under_way},
            {"quarantined", status.quarantined.size()}},
           fmt::format("samples  {} of {} written, {}{} quarantined", status.samples_written,
                       status.samples_planned, under_way_text(status), status.quarantined.size())},
          {"workers", status.writers},
          {"pairs_per_second", number(status.pairs_per_second())},
          {"seconds_left", number(status.seconds_left())},
          "work     " + work_text(status),
          {"running",
           json_list(
               status.running,
               [](const ShardAtWork& work) { return writer_json(work.file, "shard", work.shard); }),
           section("running", status.running,
                   [](const ShardAtWork& work) -> Cells {
                     return {work.shard, work.file.name.host,
                             "pid " + std::to_string(work.file.name.pid),
                             to_string(work.file.writer), age_text(work.file)};
                   })},
          {"left_over",
           json_list(status.left_over,
                     [](const UnfinishedFile& file) {
                       return writer_json(file, "file", file.path.filename().string());
                     }),
           section("left over by dead writers (deleted by the next convert)", status.left_over,
                   [](const UnfinishedFile& file) -> Cells {
                     return {file.path.filename().string(), to_string(file.writer), age_text(file)};
                   })},
          {"damaged", status.damaged,
           section("damaged (made again by the next convert)", status.damaged,
                   [](const std::string& fault) -> Cells { return {fault}; })},
          {"quarantined_by_reason", reasons},
          {"quarantined", status.quarantined,
           section("quarantined (eventgan retry makes them once their inputs are fixed)",
                   reason_rows(status), std::identity())},
          {"notes", status.notes, notes_text(status.notes)}};
}

}  // namespace

std::string status_text(const FolderStatus& status) { return text_of(table_of(status)); }
std::string status_json(const FolderStatus& status) {
  return json_text_of(table_of(status), JsonLayout::kIndented);
}

}  // namespace eventgan
