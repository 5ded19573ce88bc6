#include "pipeline/dataset/verify_folder.h"

#include <fmt/core.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/job_manifest.h"
#include "manifests/documents/report.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/text.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/dataset/source_comparison.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"
#include "pipeline/runtime/errors.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Jobs may keep their manifest in their output folder.
bool is_manifest(const fs::path& file) {
  std::string reason;
  const auto text = try_read_file(file, reason);
  FaultList faults("");
  const auto json = text ? parse_json_text(*text, faults) : std::nullopt;
  return json && json->is_object() &&
         json->value("format", nlohmann::json()) == "eventgan-manifest";
}

}  // namespace

std::vector<std::string> stray_files(const fs::path& folder, const PlanOutline& plan) {
  std::set<std::string> known = {"plan.json", "run.json", "amendments.json", "dataset.json",
                                 "dataset.h5"};
  for (const ShardOutline& shard : plan.shards) {
    known.insert(shard.name);
    known.insert(commit_record_name(shard.name));
  }
  std::vector<std::string> strays;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const fs::path& file = entry.path();
    const bool is_json = file.extension() == ".json";
    if ((file.extension() != ".h5" && !is_json) || known.contains(file.filename().string()) ||
        (is_json && is_manifest(file))) {
      continue;
    }
    strays.push_back(file.string() + ": expected files of the plan only, got another file");
  }
  std::sort(strays.begin(), strays.end());
  return strays;
}

namespace {

constexpr char kMendedBy[] = " (run eventgan finalize again)";

/// A line of indented JSON as a part of a sentence.
std::string as_value(std::string_view line) {
  constexpr std::size_t kMostShown = 120;
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  if (line.ends_with(',')) line.remove_suffix(1);
  return std::string(line.substr(0, kMostShown));
}

/// "LINE of the first, got LINE of the second", where they begin to differ.
std::string first_difference(const std::string& expected, const std::string& got) {
  std::istringstream expected_lines(expected);
  std::istringstream got_lines(got);
  std::string expected_line;
  std::string got_line;
  int number = 0;
  do {
    ++number;
    if (!std::getline(expected_lines, expected_line)) expected_line = "the end of the file";
    if (!std::getline(got_lines, got_line)) got_line = "the end of the file";
  } while (expected_line == got_line && expected_lines && got_lines);
  return as_value(expected_line) + ", got " + as_value(got_line) + ", in line " +
         std::to_string(number);
}

}  // namespace

std::vector<std::string> dataset_faults(const fs::path& folder, FrozenOutline frozen,
                                        std::vector<ShardState> shards) {
  const fs::path description = folder / kDescriptionName;
  const fs::path view = folder / kViewName;
  const bool has_view = fs::exists(view);
  if (fs::exists(description) != has_view) {
    const auto& there = has_view ? view : description;
    const auto& missing = has_view ? description : view;
    return {there.string() + ": expected " + missing.filename().string() +
            " beside it, got no file" + kMendedBy};
  }
  if (!has_view) return {};
  try {
    const DatasetParts parts = read_dataset_parts(folder, std::move(frozen), std::move(shards));
    if (parts.done.empty()) {
      return {description.string() + ": expected committed shards beside it, got none" + kMendedBy};
    }
    for (const ShardState& shard : parts.done) {
      const bool is_known = shard.outline.volume_size != ImageSize{};
      if (is_known && parts.headers.contains(shard.outline.source)) continue;
      return {description.string() +
              ": expected an intact shard of each source to compare it with, got damaged ones"};
    }
    const std::string expected = describe_present_view(folder, parts);
    const std::string got = read_text_file(description);
    if (got == expected) return {};
    return {description.string() + ": expected what the commit records and " + kViewName +
            " give: " + first_difference(expected, got) + kMendedBy};
  } catch (const std::exception& error) {
    return {description.string() + ": expected what the commit records and " + kViewName +
            " give, got neither: " + error_line(error)};
  }
}

namespace {

/// The plan that all readable commit records of the plan's shards name, if there are two or more
/// and it is not the frozen one: then the plan is what is wrong, and not each commit record.
std::optional<std::string> other_plan(const std::vector<ShardState>& shards,
                                      const std::string& plan_hash) {
  std::string other;
  int records = 0;
  for (const ShardState& shard : shards) {
    if (shard.named_plan.empty()) continue;  // reported with its shard
    if (shard.named_plan == plan_hash) return std::nullopt;
    if (++records == 1) other = shard.named_plan;
    if (shard.named_plan != other) return std::nullopt;
  }
  return records > 1 ? std::optional(other) : std::nullopt;
}

/// One check of one folder.
class Verification {
 public:
  Verification(const fs::path& folder, const VerifyOptions& options)
      : folder_(folder), options_(options) {}

  FolderCheck run() {
    const FrozenOutline frozen = read_frozen_outline(folder_);
    if (options_.deep) open_sources(frozen.plan, frozen.hash);
    std::vector<ShardState> shards =
        scan_shards(folder_, frozen.plan.shards, frozen.hash, ScanDepth::kContents,
                    {.show_phase = options_.show_phase});
    if (const auto other = other_plan(shards, frozen.hash)) {
      fault(folder_ / "plan.json", "expected the plan with SHA-256 " + *other +
                                       " that all commit records name, got " + frozen.hash +
                                       " (altered, or of another manifest)");
    }
    take_shards(shards);
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

  void open_sources(const PlanOutline& outline, const std::string& plan_hash) {
    try {
      // The frozen settings, wherever the inputs are today.
      const JobManifest recorded = recorded_manifest(folder_, outline, options_.manifest);
      JobManifest manifest = parse_job_manifest(outline.manifest_text, recorded.directory,
                                                (folder_ / "plan.json").string());
      const auto stored =
          stored_classes(folder_, outline.shards, plan_hash, manifest.sources.size());
      sources_ = std::make_unique<SourceComparison>(std::move(manifest), stored);
      append_notes(sources_->notes());
    } catch (const std::exception& error) {
      append_notes({"labels not compared: " + error_line(error)});
      return;
    }
    try {
      plan_ = read_frozen_plan(folder_).plan;
      sources_->renew_samples(plan_);
    } catch (const std::runtime_error& error) {  // samples that do not parse
      check_.faults.push_back(error_line(error));
      sources_.reset();
    }
  }

  void append_notes(const std::vector<std::string>& notes) {
    check_.notes.insert(check_.notes.end(), notes.begin(), notes.end());
  }

  void take_shards(const std::vector<ShardState>& shards) {
    Phase phase(sources_ ? options_.show_phase : ShowPhase(),
                {"shards", /*has_bytes=*/false, "comparing"}, std::ssize(shards));
    for (std::size_t i = 0; i < shards.size(); ++i) {
      check_.by_shard.push_back(look_at(i, shards[i]));
      append(check_.by_shard.back().faults);
      phase.advance();
    }
  }

  ShardCheck look_at(std::size_t index, const ShardState& shard) {
    ShardCheck check{
        .name = shard.outline.name, .condition = shard.condition, .faults = shard.faults};
    if (shard.condition == ShardCondition::kMissing) {
      check.faults.push_back(
          (folder_ / commit_record_name(check.name)).string() +
          ": expected the shard and its commit record, got neither (not made yet)");
    }
    if (!shard.done()) return check;
    check.size_bytes = shard.record->size_bytes;
    check.samples = shard.record->samples;
    check.quarantined = shard.record->samples - shard.record->valid;
    check_.samples += shard.record->samples;
    check_.valid += shard.record->valid;
    if (!sources_ || !shard.sound()) return check;
    const long long compared_before = sources_->compared();
    const fs::path file = folder_ / check.name;
    for (const std::string& what : sources_->faults(plan_.shards.at(index), ShardReader(file))) {
      check.faults.push_back(file.string() + ": " + what);
    }
    check.compared = sources_->compared() - compared_before;
    return check;
  }

  void check_amendments(const std::string& plan_hash) {
    try {
      read_amendments(folder_, plan_hash);
    } catch (const std::runtime_error& error) {
      check_.faults.push_back(error_line(error));
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

namespace {

/// What was done with a shard, and what came of it.
std::string line_of(const ShardCheck& shard, bool deep) {
  if (shard.condition != ShardCondition::kDone) {
    return shard.name + ": " + to_string(shard.condition);
  }
  std::string text = fmt::format(
      "{}: {}, {} hashed, {} read, {} quarantined", shard.name,
      shard.faults.empty() ? "sound" : count_text(std::ssize(shard.faults), "fault"),
      bytes_text(shard.size_bytes), count_text(shard.samples, "sample"), shard.quarantined);
  if (deep) text += fmt::format(", labels of {} compared", shard.compared);
  return text;
}

Report table_of(const FolderCheck& check, bool deep, const fs::path& folder) {
  const std::string shards = count_text(check.shards(), "shard");
  return {
      {"folder", folder.string()},
      {"notes", check.notes, listed(check.notes, "note: {}")},
      {"shards",
       json_list(check.by_shard,
                 [](const ShardCheck& shard) -> nlohmann::json {
                   return {{"shard", shard.name},
                           {"condition", to_string(shard.condition)},
                           {"size_bytes", shard.size_bytes},
                           {"samples", shard.samples},
                           {"quarantined", shard.quarantined},
                           {"compared", shard.compared},
                           {"faults", shard.faults}};
                 }),
       joined(check.by_shard, "",
              [&](const ShardCheck& shard) { return line_of(shard, deep) + "\n"; })},
      {"faults", check.faults, listed(check.faults)},
      {"compared", check.compared},
      deep ? "labels of " + count_text(check.compared, "sample") + " compared with their sources"
           : "",
      {"sound", check.sound()},
      {"samples", check.samples},
      {"valid", check.valid},
      {"quarantined", check.samples - check.valid},
      check.sound() ? fmt::format("sound: {}, {}, {} of them quarantined", shards,
                                  count_text(check.samples, "sample"), check.samples - check.valid)
                    : count_text(std::ssize(check.faults), "fault") + " in " + shards};
}

}  // namespace

std::string to_text(const FolderCheck& check, bool deep) {
  return text_of(table_of(check, deep, {}));
}
std::string to_json(const FolderCheck& check, const fs::path& folder) {
  return json_text_of(table_of(check, false, folder));
}

}  // namespace eventgan
