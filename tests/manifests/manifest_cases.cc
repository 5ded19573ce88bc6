#include "tests/manifests/manifest_cases.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

namespace eventgan::testing {

const char kSoundManifest[] = R"({
  "format": "eventgan-manifest", "version": 1, "name": "events",
  "sources": [{"dataset": "kitti_raw", "root": "raw", "pairs": {"gaps": [1, 2]}}],
  "image": {"width": 64, "height": 32, "preset": "kitti"},
  "generator": {"weights": "w.safetensors"},
  "volume": {},
  "output": {"directory": "out"},
  "errors": {}
})";

std::string edited(const char* sound, const std::vector<Edit>& edits) {
  nlohmann::json document = nlohmann::json::parse(sound);
  for (const Edit& edit : edits) {
    const nlohmann::json::json_pointer place(edit.pointer);
    if (!edit.value.empty()) {
      document[place] = nlohmann::json::parse(edit.value);
    } else {
      document.at(place.parent_pointer()).erase(place.back());
    }
  }
  return document.dump();
}

std::string manifest_text(const ManifestCase& manifest_case) {
  return edited(kSoundManifest, manifest_case.edits);
}

std::string test_name(const ManifestCase& manifest_case) {
  std::string name = manifest_case.name;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !std::isalnum(c); }, '_');
  return name;
}

std::vector<ManifestCase> manifest_cases() {
  std::vector<ManifestCase> all;
  for (const auto& part : {top_cases(), source_cases(), setting_cases(), generator_cases()}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace eventgan::testing
