#include "pipeline/verification/verify_folder.h"

#include <exception>
#include <memory>
#include <set>
#include <stdexcept>
#include <utility>

#include "pipeline/output/amendments.h"
#include "pipeline/output/output_folder.h"
#include "pipeline/output/recorded_manifest.h"
#include "pipeline/output/shard_state.h"
#include "pipeline/threads/for_each_index.h"
#include "pipeline/threads/thread_count.h"
#include "pipeline/verification/dataset_check.h"
#include "pipeline/verification/fault_line.h"
#include "pipeline/verification/source_comparison.h"
#include "pipeline/verification/stray_files.h"
#include "stages/files/text_file.h"
#include "stages/files/unfinished_files.h"
#include "stages/shards/shard_check.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The plan that all readable markers of the plan's shards name, if there are two or more and it is
/// not the frozen one: then the plan is what is wrong, and not each marker.
std::optional<std::string> other_plan(const fs::path& folder, const FrozenOutline& frozen) {
  std::set<std::string> hashes;
  int markers = 0;
  for (const ShardOutline& shard : frozen.plan.shards) {
    try {
      const std::string text = read_text_file(folder / marker_name(shard.name));
      hashes.insert(parse_marker(text, shard.name).plan_hash);
      ++markers;
    } catch (const std::runtime_error&) {  // reported with its shard
    }
    if (hashes.size() > 1 || hashes.contains(frozen.hash)) return std::nullopt;
  }
  return markers > 1 ? std::optional(*hashes.begin()) : std::nullopt;
}

/// One check of one folder.
class Verification {
 public:
  Verification(const fs::path& folder, const VerifyOptions& options)
      : folder_(folder), options_(options) {}

  FolderCheck run() {
    const FrozenOutline frozen = read_frozen_outline(folder_);
    if (options_.deep) open_sources(frozen.plan);
    if (const auto other = other_plan(folder_, frozen)) {
      fault(folder_ / "plan.json", "expected the plan with SHA-256 " + *other +
                                       " that all markers name, got " + frozen.hash +
                                       " (altered, or of another manifest)");
    }
    check_shards(frozen);
    append(stray_files(folder_, frozen.plan));
    append(dataset_faults(folder_, frozen, std::move(states_), sound_));
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

  /// Shards side by side; what is found is told in their order.
  void check_shards(const FrozenOutline& frozen) {
    const std::vector<ShardOutline>& shards = frozen.plan.shards;
    states_.resize(shards.size());
    std::vector<std::vector<std::string>> faults(shards.size());
    for_each_index(shards.size(), thread_count(0), [&](std::size_t i) {
      states_[i] = shard_state(folder_, shards[i], frozen.hash);  // check_shard hashes
      if (states_[i].done()) faults[i] = check_shard(folder_ / shards[i].name, *states_[i].marker);
    });
    for (std::size_t i = 0; i < shards.size(); ++i) {
      ++check_.shards;
      sound_.push_back(states_[i].done() && faults[i].empty());
      tell_shard(i, shards[i], faults[i]);
    }
  }

  void tell_shard(std::size_t index, const ShardOutline& shard,
                  const std::vector<std::string>& faults) {
    const fs::path file = folder_ / shard.name;
    const ShardState& state = states_[index];
    if (state.condition == ShardCondition::kMissing) {
      return fault(folder_ / marker_name(shard.name),
                   "expected the shard and its marker, got neither (not made yet)");
    }
    if (!state.done()) {
      check_.faults.push_back(state.fault);
      return;
    }
    check_.samples += state.marker->samples;
    check_.valid += state.marker->valid;
    append(faults);
    if (!sources_ || !faults.empty()) return;
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
  std::vector<ShardState> states_;  // of the plan's shards
  std::vector<bool> sound_;         // whether HDF5 may open them
  Plan plan_;                       // deep only: it can be huge
  std::unique_ptr<SourceComparison> sources_;
};

}  // namespace

FolderCheck verify_folder(const fs::path& folder, const VerifyOptions& options) {
  return Verification(folder, options).run();
}

}  // namespace eventgan
