#include "pipeline/verification/verify_folder.h"

#include <exception>
#include <memory>
#include <stdexcept>
#include <utility>

#include "pipeline/output/amendments.h"
#include "pipeline/output/output_folder.h"
#include "pipeline/output/recorded_manifest.h"
#include "pipeline/output/shard_scan.h"
#include "pipeline/verification/dataset_check.h"
#include "pipeline/verification/fault_line.h"
#include "pipeline/verification/source_comparison.h"
#include "pipeline/verification/stray_files.h"
#include "stages/files/unfinished_files.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The plan that all readable markers of the plan's shards name, if there are two or more and it is
/// not the frozen one: then the plan is what is wrong, and not each marker.
std::optional<std::string> other_plan(const std::vector<ShardState>& shards,
                                      const std::string& plan_hash) {
  std::string other;
  int markers = 0;
  for (const ShardState& shard : shards) {
    if (shard.named_plan.empty()) continue;  // reported with its shard
    if (shard.named_plan == plan_hash) return std::nullopt;
    if (++markers == 1) other = shard.named_plan;
    if (shard.named_plan != other) return std::nullopt;
  }
  return markers > 1 ? std::optional(other) : std::nullopt;
}

/// One check of one folder.
class Verification {
 public:
  Verification(const fs::path& folder, const VerifyOptions& options)
      : folder_(folder), options_(options) {}

  FolderCheck run() {
    const FrozenOutline frozen = read_frozen_outline(folder_);
    if (options_.deep) open_sources(frozen.plan);
    std::vector<ShardState> shards =
        scan_shards(folder_, frozen.plan.shards, frozen.hash, ScanDepth::kContents);
    if (const auto other = other_plan(shards, frozen.hash)) {
      fault(folder_ / "plan.json", "expected the plan with SHA-256 " + *other +
                                       " that all markers name, got " + frozen.hash +
                                       " (altered, or of another manifest)");
    }
    for (std::size_t i = 0; i < shards.size(); ++i) tell_shard(i, shards[i]);
    append(stray_files(folder_, frozen.plan));
    append(dataset_faults(folder_, frozen, std::move(shards)));
    check_amendments(frozen.hash);
    note_temporaries();
    if (sources_) check_.compared = sources_->compared();
    return std::move(check_);
  }

 private:
  void fault(const fs::path& path, const std::string& what) {
    check_.faults.push_back(path.string() + ": " + what);
  }

  void append(const std::vector<std::string>& faults) {
    check_.faults.insert(check_.faults.end(), faults.begin(), faults.end());
  }

  void open_sources(const PlanOutline& outline) {
    try {
      // The frozen settings, wherever the inputs are today.
      const JobManifest recorded = recorded_manifest(folder_, outline, options_.manifest);
      sources_ = std::make_unique<SourceComparison>(parse_job_manifest(
          outline.manifest_text, recorded.directory, (folder_ / "plan.json").string()));
      append_notes(sources_->notes());
    } catch (const std::exception& error) {
      append_notes({"labels not compared: " + fault_line(error)});
      return;
    }
    try {
      plan_ = read_frozen_plan(folder_).plan;
      sources_->renew_samples(plan_);
    } catch (const std::runtime_error& error) {  // samples that do not parse
      check_.faults.push_back(fault_line(error));
      sources_.reset();
    }
  }

  void append_notes(const std::vector<std::string>& notes) {
    check_.notes.insert(check_.notes.end(), notes.begin(), notes.end());
  }

  void tell_shard(std::size_t index, const ShardState& shard) {
    ++check_.shards;
    if (shard.condition == ShardCondition::kMissing) {
      return fault(folder_ / marker_name(shard.outline.name),
                   "expected the shard and its marker, got neither (not made yet)");
    }
    append(shard.faults);
    if (!shard.done()) return;
    check_.samples += shard.marker->samples;
    check_.valid += shard.marker->valid;
    if (!sources_ || !shard.sound()) return;
    const fs::path file = folder_ / shard.outline.name;
    for (const std::string& what : sources_->faults(plan_.shards.at(index), ShardReader(file))) {
      fault(file, what);
    }
  }

  void check_amendments(const std::string& plan_hash) {
    try {
      read_amendments(folder_, plan_hash);
    } catch (const std::runtime_error& error) {
      check_.faults.push_back(fault_line(error));
    }
  }

  void note_temporaries() {
    for (const UnfinishedFile& file : unfinished_files(folder_)) {
      check_.notes.push_back(file.path.string() + (is_stale(file)
                                                       ? ": left over by a writer that has ended"
                                                       : ": being written by another process"));
    }
  }

  const fs::path& folder_;
  const VerifyOptions& options_;
  FolderCheck check_;
  Plan plan_;  // deep only: it can be huge
  std::unique_ptr<SourceComparison> sources_;
};

}  // namespace

FolderCheck verify_folder(const fs::path& folder, const VerifyOptions& options) {
  return Verification(folder, options).run();
}

}  // namespace eventgan
