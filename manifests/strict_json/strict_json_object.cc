#include <algorithm>
#include <nlohmann/json.hpp>

#include "manifests/strict_json/json_path_internal.h"
#include "manifests/strict_json/near_word_internal.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

StrictObject::StrictObject(const nlohmann::json* node, std::string path, FaultList& faults)
    : node_(node), path_(std::move(path)), faults_(&faults) {}

StrictValue StrictObject::at(std::string_view key) {
  if (auto value = find(key)) return *std::move(value);
  const auto state = node_ == nullptr ? StrictValue::State::kSilent : StrictValue::State::kMissing;
  return StrictValue(nullptr, state, json_path(path_, key), *faults_);
}

std::optional<StrictValue> StrictObject::find(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  if (node_ == nullptr) return std::nullopt;
  const auto found = node_->find(key);
  if (found == node_->end()) return std::nullopt;
  return StrictValue(&*found, StrictValue::State::kPresent, json_path(path_, key), *faults_);
}

bool StrictObject::has_format(std::string_view format, int version) {
  const StrictValue found_format = at("format");
  const StrictValue found_version = at("version");
  const bool is_format = found_format.node_ != nullptr && *found_format.node_ == format;
  const bool is_version = found_version.node_ != nullptr &&
                          found_version.node_->is_number_integer() &&
                          *found_version.node_ == version;
  if (!is_format) found_format.fault("\"" + std::string(format) + "\"");
  if (!is_version) {
    found_version.fault(std::to_string(version) + " (the version that this program reads)");
  }
  return is_format && is_version;
}

void StrictObject::finish() const {
  if (node_ == nullptr) return;
  std::string known;
  for (const std::string_view key : known_) known.append(known.empty() ? "" : ", ").append(key);
  for (const auto& [key, value] : node_->items()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    const std::string_view meant = near_word(key, known_);
    const std::string expected = meant.empty() ? "one of the keys " + known
                                               : "the key \"" + std::string(meant) + "\" or none";
    faults_->add(json_path(path_, key), expected, "an unknown key");
  }
}

}  // namespace eventgan
