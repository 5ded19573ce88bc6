#include "pipeline/folder/status_text.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "manifests/plan.h"
#include "pipeline/progress/progress.h"

namespace eventgan {
namespace {

/// Lists for a person end here; --json has everything.
constexpr std::size_t kListed = 20;

/// Rows of cells, the columns aligned, each row indented; cut after kListed rows.
std::string table(const std::vector<std::vector<std::string>>& rows) {
  const std::size_t shown = std::min(rows.size(), kListed);
  std::vector<std::size_t> widths;
  for (std::size_t i = 0; i < shown; ++i) {
    widths.resize(std::max(widths.size(), rows[i].size()));
    for (std::size_t j = 0; j < rows[i].size(); ++j) {
      widths[j] = std::max(widths[j], rows[i][j].size());
    }
  }
  std::string text;
  for (std::size_t i = 0; i < shown; ++i) {
    text += "  ";
    for (std::size_t j = 0; j + 1 < rows[i].size(); ++j) {
      text += rows[i][j] + std::string(widths[j] - rows[i][j].size() + 2, ' ');
    }
    text += rows[i].back() + "\n";
  }
  if (rows.size() > shown) {
    text += fmt::format("  ... and {} more (--json lists them)\n", rows.size() - shown);
  }
  return text;
}

std::string section(const std::string& title, const std::vector<std::vector<std::string>>& rows) {
  return rows.empty() ? "" : title + "\n" + table(rows);
}

std::string age_text(const UnfinishedFile& file) {
  return "last wrote " + duration_text(file.silent_s, "dhms") + " ago";
}

std::vector<std::vector<std::string>> running_rows(const FolderStatus& status) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& [shard, file] : status.running) {
    rows.push_back({shard, file.name.host, "pid " + std::to_string(file.name.pid),
                    to_string(file.writer), age_text(file)});
  }
  return rows;
}

std::vector<std::vector<std::string>> left_over_rows(const FolderStatus& status) {
  std::vector<std::vector<std::string>> rows;
  for (const UnfinishedFile& file : status.left_over) {
    rows.push_back({file.path.filename().string(), to_string(file.writer), age_text(file)});
  }
  return rows;
}

std::vector<std::vector<std::string>> damaged_rows(const FolderStatus& status) {
  std::vector<std::vector<std::string>> rows;
  for (const std::string& fault : status.damaged) rows.push_back({fault});
  return rows;
}

/// A row a reason, the commonest first, with one of its samples.
std::vector<std::vector<std::string>> reason_rows(const FolderStatus& status) {
  std::map<std::string, std::vector<const QuarantinedSlot*>> by_kind;
  for (const QuarantinedSlot& sample : status.quarantined) {
    by_kind[fault_kind(sample.reason)].push_back(&sample);
  }
  std::vector<std::pair<std::string, std::vector<const QuarantinedSlot*>>> kinds(by_kind.begin(),
                                                                                 by_kind.end());
  std::stable_sort(kinds.begin(), kinds.end(), [](const auto& one, const auto& other) {
    return one.second.size() > other.second.size();
  });
  std::vector<std::vector<std::string>> rows;
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
      status.writers == 0 ? "nobody is at work"
                          : fmt::format("{} {} at work", status.writers,
                                        status.writers == 1 ? "process is" : "processes are");
  if (status.complete()) return at_work + ", and every shard is done";
  if (status.writers == 0) return at_work + "; eventgan convert goes on from here";
  const auto rate = status.pairs_per_second();
  const auto left = status.seconds_left();
  if (!rate || !left) return at_work + ", how fast is known after the first shard";
  return fmt::format("{}, {:.3g} pairs/s, about {} left", at_work, *rate,
                     duration_text(*left, "dhms"));
}

}  // namespace

std::string status_text(const FolderStatus& status) {
  return fmt::format("folder   {}\n", status.folder.string()) +
         fmt::format("plan     {:.16}\n", status.plan_hash) +
         fmt::format("shards   {}\n", shards_text(status)) +
         fmt::format("samples  {} of {} written, {} quarantined\n", status.samples_written,
                     status.samples_planned, status.quarantined.size()) +
         fmt::format("work     {}\n", work_text(status)) +
         section("running", running_rows(status)) +
         section("left over by dead writers (deleted by the next convert)",
                 left_over_rows(status)) +
         section("damaged (made again by the next convert)", damaged_rows(status)) +
         section("quarantined (eventgan retry makes them once their inputs are mended)",
                 reason_rows(status)) +
         notes_text(status.notes);
}

}  // namespace eventgan
