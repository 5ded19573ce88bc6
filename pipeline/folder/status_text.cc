#include "pipeline/folder/status_text.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <utility>
#include <vector>

#include "manifests/plan.h"

namespace eventgan {
namespace {

/// Lists for a person end here; --json has everything.
constexpr std::size_t kListed = 20;

std::string duration(double seconds) {
  const auto whole = static_cast<long long>(seconds + 0.5);
  char text[64];
  if (whole >= 86400) {
    std::snprintf(text, sizeof text, "%lldd%02lldh", whole / 86400, whole / 3600 % 24);
  } else if (whole >= 3600) {
    std::snprintf(text, sizeof text, "%lldh%02lldm", whole / 3600, whole / 60 % 60);
  } else if (whole >= 60) {
    std::snprintf(text, sizeof text, "%lldm%02llds", whole / 60, whole % 60);
  } else {
    std::snprintf(text, sizeof text, "%llds", whole);
  }
  return text;
}

std::string rate_text(double pairs_per_second) {
  char text[64];
  std::snprintf(text, sizeof text, "%.3g pairs/s", pairs_per_second);
  return text;
}

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
    text += "  ... and " + std::to_string(rows.size() - shown) + " more (--json lists them)\n";
  }
  return text;
}

std::string section(const std::string& title, const std::vector<std::vector<std::string>>& rows) {
  return rows.empty() ? "" : title + "\n" + table(rows);
}

std::string age_text(const UnfinishedFile& file) {
  return "last wrote " + duration(file.silent_s) + " ago";
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
                    kind + (samples.size() == 1 ? " (" : " (first: ") + first.sample_id + ", " +
                        first.shard + " slot " + std::to_string(first.slot) + ")"});
  }
  return rows;
}

std::string shards_text(const FolderStatus& status) {
  std::string text = std::to_string(status.shards_done) + " of " +
                     std::to_string(status.shards_planned) + " done, " +
                     std::to_string(status.shards_running) + " running, " +
                     std::to_string(status.shards_missing()) + " missing";
  if (!status.damaged.empty()) {
    text += " (" + std::to_string(status.damaged.size()) + " of them damaged)";
  }
  return text;
}

std::string samples_text(const FolderStatus& status) {
  return std::to_string(status.samples_written) + " of " + std::to_string(status.samples_planned) +
         " written, " + std::to_string(status.quarantined.size()) + " quarantined";
}

std::string work_text(const FolderStatus& status) {
  const std::string at_work =
      status.writers == 0
          ? "nobody is at work"
          : std::to_string(status.writers) +
                (status.writers == 1 ? " process is at work" : " processes are at work");
  if (status.complete()) return at_work + ", and every shard is done";
  if (status.writers == 0) return at_work + "; eventgan convert goes on from here";
  const auto rate = status.pairs_per_second();
  const auto left = status.seconds_left();
  if (!rate || !left) return at_work + ", how fast is known after the first shard";
  return at_work + ", " + rate_text(*rate) + ", about " + duration(*left) + " left";
}

}  // namespace

std::string status_text(const FolderStatus& status) {
  return "folder   " + status.folder.string() + "\n" +          //
         "plan     " + status.plan_hash.substr(0, 16) + "\n" +  //
         "shards   " + shards_text(status) + "\n" +             //
         "samples  " + samples_text(status) + "\n" +            //
         "work     " + work_text(status) + "\n" +               //
         section("running", running_rows(status)) +
         section("left over by dead writers (deleted by the next convert)",
                 left_over_rows(status)) +
         section("damaged (made again by the next convert)", damaged_rows(status)) +
         section("quarantined (eventgan retry makes them once their inputs are mended)",
                 reason_rows(status)) +
         notes_text(status.notes);
}

}  // namespace eventgan
