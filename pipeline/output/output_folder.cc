#include "pipeline/output/output_folder.h"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/faults.h"
#include "stages/files/atomic_file.h"
#include "stages/files/sha256.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kPlanName[] = "plan.json";
constexpr char kRunName[] = "run.json";

std::optional<std::string> read_text(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return std::nullopt;
  return std::string{std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace

FrozenPlan read_frozen_plan(const fs::path& folder) {
  const fs::path file = folder / kPlanName;
  const std::optional<std::string> text = read_text(file);
  if (!text) {
    throw InputError("expected a folder that eventgan convert has written, got no " +
                     file.string());
  }
  try {
    return {parse_plan(*text, file.string()), sha256_hex(*text)};
  } catch (const std::runtime_error&) {
    std::throw_with_nested(std::runtime_error("expected a whole plan, got a damaged one, in " +
                                              file.string() + " (--overwrite starts again)"));
  }
}

FrozenPlan freeze_plan(const fs::path& folder, const Plan& plan) {
  const std::string text = to_json(plan);
  if (create_file_atomically(folder / kPlanName, text) || read_text(folder / kPlanName) == text) {
    return {plan, sha256_hex(text)};
  }
  FrozenPlan frozen = read_frozen_plan(folder);
  const auto differences = fingerprint_differences(frozen.plan.fingerprint, plan.fingerprint);
  if (differences.empty()) {
    // The manifest may differ in what does not change bytes; nothing else may.
    Plan same = plan;
    same.manifest_text = frozen.plan.manifest_text;
    if (sha256_hex(to_json(same)) == frozen.hash) return frozen;
    throw UsageError(
        "expected the plan that this manifest and these inputs give, got an altered one, in " +
        (folder / kPlanName).string() + " (--overwrite starts again)");
  }
  std::string message =
      (folder / kPlanName).string() +
      " was frozen by a run that would have written other bytes (--overwrite starts again):";
  for (const std::string& difference : differences) message += "\n  " + difference;
  throw UsageError(message);
}

void discard_output(const fs::path& folder) {
  const std::optional<std::string> text = read_text(folder / kPlanName);
  if (!text) return;
  std::vector<PlannedShard> shards;
  try {
    shards = parse_plan(*text, kPlanName).shards;
  } catch (const std::runtime_error&) {
    // A damaged plan names no shards; those that are left are made anew, or reported by `verify`.
  }
  for (const PlannedShard& shard : shards) {
    // The marker first: without it the shard counts for nothing.
    fs::remove(folder / marker_name(shard.name));
    fs::remove(folder / shard.name);
  }
  fs::remove(folder / kPlanName);
}

std::optional<ShardMarker> done_marker(const fs::path& folder, const PlannedShard& shard,
                                       const std::string& plan_hash) {
  const fs::path file = folder / marker_name(shard.name);
  const std::optional<std::string> text = read_text(file);
  if (!text) return std::nullopt;
  try {
    ShardMarker marker = parse_marker(*text, file.string());
    std::error_code absent;
    const auto size = fs::file_size(folder / shard.name, absent);
    const bool done = !absent && marker.shard == shard.name && marker.plan_hash == plan_hash &&
                      size == static_cast<std::uintmax_t>(marker.size_bytes);
    return done ? std::optional(std::move(marker)) : std::nullopt;
  } catch (const std::runtime_error&) {
    return std::nullopt;  // a torn marker: the shard is made again
  }
}

void record_manifest_folder(const fs::path& folder, const JobManifest& manifest) {
  const nlohmann::json json = {{"manifest_folder", manifest.directory.string()}};
  write_file_atomically(folder / kRunName, json.dump(2) + "\n");
}

std::optional<fs::path> recorded_manifest_folder(const fs::path& folder) {
  const std::optional<std::string> text = read_text(folder / kRunName);
  if (!text) return std::nullopt;
  const auto json = nlohmann::json::parse(*text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("manifest_folder")) return std::nullopt;
  const auto& value = json["manifest_folder"];
  return value.is_string() ? std::optional<fs::path>(value.get<std::string>()) : std::nullopt;
}

}  // namespace eventgan
