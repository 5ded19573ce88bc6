#include "pipeline/exports/export_input.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/documents/json_text.h"
#include "manifests/files/input_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/generators.h"
#include "manifests/values/pair_key.h"
#include "pipeline/dataset/dataset_description.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kWayOut[] = " (run eventgan finalize again)";

nlohmann::json read_dataset_json(const fs::path& folder) {
  const fs::path file = folder / kDescriptionName;
  std::string reason;
  const auto text = try_read_file(file, reason);
  if (!text) {
    throw InputError("expected a folder that eventgan finalize has completed, got no " +
                     file.string() + ": " + reason);
  }
  FaultList faults(file.string());
  auto json = parse_json_text(*text, faults);
  if (!faults.empty()) throw InputError(faults.text() + kWayOut);
  return *std::move(json);
}

/// Throws InputError unless the shard stands, as far as `depth` goes, with the hash that
/// dataset.json has.
ShardState require_shard(const fs::path& folder, const ShardOutline& outline,
                         const std::string& plan_hash, const std::string& sha256, ScanDepth depth) {
  ShardState state = shard_state(folder, outline, plan_hash, depth);
  if (!state.done()) {
    throw InputError(state.faults.empty() ? fmt::format("expected a shard, got none, in {}",
                                                        (folder / outline.name).string())
                                          : state.faults.front());
  }
  if (state.record->sha256 != sha256) {
    throw InputError(
        fmt::format("expected the shard that was finalized, SHA-256 {}, got {}, in {} (run "
                    "eventgan finalize again)",
                    sha256, state.record->sha256, (folder / outline.name).string()));
  }
  return state;
}

}  // namespace

ExportInput::ExportInput(const fs::path& folder, const std::vector<std::string>& splits)
    : folder_(folder) {
  try {
    read_description(splits);
  } catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("expected what eventgan finalize writes, got {}, in {}{}",
                                 error.what(), (folder / kDescriptionName).string(), kWayOut));
  }
  name_sources();
}

void ExportInput::read_description(const std::vector<std::string>& splits) {
  const nlohmann::json json = read_dataset_json(folder_);
  const fs::path file = folder_ / kDescriptionName;
  if (json.at("format") != kDatasetFormat) {
    throw InputError("expected format " + std::string(kDatasetFormat) + ", got another, in " +
                     file.string());
  }
  const auto& version = json.at("version");
  const std::string found = version.is_string() ? version.get<std::string>() : "";
  if (!readable_version(found, kDatasetVersion)) {
    throw InputError("expected version " + readable_versions(kDatasetVersion) + ", got " +
                     dump_json(version) + ", in " + file.string());
  }
  const FrozenOutline frozen = read_frozen_outline(folder_);
  name_ = json.at("name");
  plan_hash_ = json.at("plan_hash");
  if (plan_hash_ != frozen.hash) {
    throw InputError("expected the plan of dataset.json, SHA-256 " + plan_hash_ + ", got " +
                     frozen.hash + ", in " + (folder_ / "plan.json").string() + kWayOut);
  }
  missing_ = json.at("missing");
  const JobManifest manifest =
      parse_job_manifest(frozen.plan.manifest_text, folder_, (folder_ / "plan.json").string());
  has_recordings_ = !needs_frames(manifest.generator.kind);
  Sha256 sources;
  for (const SourceSpec& spec : manifest.sources) {
    sources.update(fmt::format("{}\n{}\n{}\n", to_string(spec.dataset), spec.root, spec.split));
    ExportSource& known = sources_.emplace_back();
    known.dataset = to_string(spec.dataset);
    known.split = spec.split;
    known.key = source_key(manifest.sources, sources_.size() - 1);
    known.has_coco_labels = spec.labels && spec.labels->format == LabelFormat::kCoco;
    const auto& source = json.at("sources").at(sources_.size() - 1);
    if (source.at("dataset") != known.dataset || source.at("split") != known.split) {
      throw InputError(fmt::format(
          "expected {}, split {}, as source {} of the plan, got {}, split "
          "{}, in {}{}",
          known.dataset, known.split, sources_.size() - 1,
          dump_json(source.at("dataset"), JsonLayout::kAsciiLine),
          dump_json(source.at("split"), JsonLayout::kAsciiLine), file.string(), kWayOut));
    }
    if (source.at("class_names").is_array()) known.class_names = source.at("class_names");
    if (source.at("joint_names").is_array()) known.joint_names = source.at("joint_names");
  }
  sources_hash_ = sources.hex();
  std::vector<std::string> there;
  for (const ExportSource& source : sources_) {
    if (std::ranges::find(there, source.split) == there.end()) there.push_back(source.split);
  }
  for (const std::string& split : splits) {
    if (std::ranges::find(there, split) != there.end()) continue;
    throw UsageError(
        fmt::format("--split: expected one of {}, got {}", fmt::join(there, ", "), split));
  }
  for (const std::string& split : there) {
    if (splits.empty() || std::ranges::find(splits, split) != splits.end()) {
      splits_.push_back(split);
    }
  }
  std::map<std::string, std::string> hashes;
  for (const auto& shard : json.at("shards")) hashes[shard.at("name")] = shard.at("sha256");
  for (const ShardOutline& outline : frozen.plan.shards) {
    const auto hash = hashes.find(outline.name);
    if (hash == hashes.end()) continue;
    ExportSource& source = sources_.at(static_cast<std::size_t>(outline.source));
    if (source.any_shard.empty()) source.any_shard = outline.name;
    if (std::ranges::find(splits_, source.split) == splits_.end()) continue;
    ShardState state =
        require_shard(folder_, outline, plan_hash_, hash->second, ScanDepth::kRecord);
    shards_.push_back(
        {outline, hash->second, state.record->valid, std::move(state.record->quarantined)});
  }
}

void ExportInput::name_sources() {
  std::map<std::string, int> in_split;
  for (const ExportSource& source : sources_) ++in_split[source.split];
  std::map<std::string, int> of_kind;
  for (ExportSource& source : sources_) {
    if (in_split[source.split] == 1) continue;
    const int number = ++of_kind[source.split + " " + source.dataset];
    source.name_prefix =
        source.dataset + (number > 1 ? "-" + std::to_string(number) : std::string()) + "+";
  }
}

ShardReader ExportInput::open(const ExportShard& shard) const {
  const std::string& name = shard.outline.name;
  {
    const std::lock_guard lock(mutex_);
    if (!hashed_.contains(name)) {
      require_shard(folder_, shard.outline, plan_hash_, shard.sha256, ScanDepth::kBytes);
      hashed_.insert(name);
    }
  }
  return ShardReader(folder_ / name);
}

std::vector<LabelSchema> ExportInput::joint_schemas() const {
  std::vector<LabelSchema> schemas;
  for (const ExportSource& source : sources_) {
    const auto is_of_it = [&](const auto& other) {
      return other.joint_names == source.joint_names;
    };
    if (!source.has_joints() || std::ranges::any_of(schemas, is_of_it)) continue;
    // Shards of the chosen splits are there; those of others may be elsewhere.
    const auto chosen = std::ranges::find_if(
        shards_, [&](const ExportShard& shard) { return is_of_it(source_of(shard)); });
    const std::string& shard = chosen == shards_.end() ? source.any_shard : chosen->outline.name;
    schemas.push_back(ShardReader(folder_ / shard).header().label_schema);
  }
  return schemas;
}

std::vector<ExportSet> ExportInput::sets(bool joints_only, bool by_size) const {
  struct Key {
    std::string split, dataset;
    std::vector<std::string> joints;
    ImageSize size;
    bool operator==(const Key&) const = default;
  };
  std::vector<Key> keys;
  std::vector<ExportSet> sets;
  for (const ExportShard& shard : shards_) {
    const ExportSource& source = source_of(shard);
    if (joints_only && !source.has_joints()) continue;
    Key key{source.split, source.dataset, source.joint_names, {}};
    if (by_size) {
      key.size =
          shard.outline.size_unknown ? open(shard).header().volume.size : shard.outline.volume_size;
    }
    const auto at = std::ranges::find(keys, key) - keys.begin();
    if (static_cast<std::size_t>(at) == keys.size()) {
      keys.push_back(key);
      sets.push_back({"", source.split, {}});
    }
    sets[static_cast<std::size_t>(at)].shards.push_back(&shard);
  }
  // The shortest name that tells a set from the others of its split.
  for (std::size_t i = 0; i < sets.size(); ++i) {
    const auto others = [&](auto same) {
      int count = -1;  // itself
      for (const Key& key : keys) count += same(key, keys[i]) ? 1 : 0;
      return count;
    };
    const auto same_split = [](const Key& a, const Key& b) { return a.split == b.split; };
    const auto same_kind = [&](const Key& a, const Key& b) {
      return same_split(a, b) && a.dataset == b.dataset;
    };
    const auto same_size = [&](const Key& a, const Key& b) {
      return same_kind(a, b) && a.size == b.size;
    };
    std::string& name = sets[i].name;
    name = keys[i].split;
    if (others(same_split) > 0) name += "-" + keys[i].dataset;
    if (by_size && others(same_kind) > 0) {
      name += fmt::format("-{}x{}", keys[i].size.height, keys[i].size.width);
    }
    const auto earlier = std::count_if(keys.begin(), keys.begin() + static_cast<std::ptrdiff_t>(i),
                                       [&](const Key& key) { return same_size(key, keys[i]); });
    if (earlier > 0) name += "-" + std::to_string(earlier + 1);
  }
  return sets;
}

}  // namespace eventgan
