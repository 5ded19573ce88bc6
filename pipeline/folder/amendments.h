#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace eventgan {

/// A retry after inputs were mended: the plan stays, the fingerprint's fields for inputs change.
struct Amendment {
  std::map<std::string, std::string> fields;  ///< fingerprint fields with their value since then
  std::vector<std::string> samples;           ///< samples redone, by id, in plan order
  bool operator==(const Amendment&) const = default;
};

/// The fingerprint's fields that may change between freezing and a retry: those of inputs.
bool is_amendable(const std::string& fingerprint_field);

/// Those that may be added between freezing and a retry, and then stay: what labels mean.
bool is_addable(const std::string& fingerprint_field);

/// FOLDER/amendments.json, oldest first; none if there is no such file or it belongs to another
/// plan. Throws std::runtime_error if it is damaged.
std::vector<Amendment> read_amendments(const std::filesystem::path& folder,
                                       const std::string& plan_hash);

/// Adds one, unless the last is the same; atomically, also beside others that do; before the first
/// shard is touched. Throws std::invalid_argument for a field that may not change,
/// std::runtime_error if the file is damaged or cannot be written.
void record_amendment(const std::filesystem::path& folder, const std::string& plan_hash,
                      const Amendment& amendment);

/// The frozen fingerprint with the amendments' fields, newest last.
std::map<std::string, std::string> amended(std::map<std::string, std::string> fingerprint,
                                           const std::vector<Amendment>& amendments);

}  // namespace eventgan
