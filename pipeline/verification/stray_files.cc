#include "pipeline/verification/stray_files.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "manifests/marker.h"
#include "manifests/strict_json/json_text_internal.h"
#include "stages/files/text_file.h"

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
    known.insert(marker_name(shard.name));
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

}  // namespace eventgan
