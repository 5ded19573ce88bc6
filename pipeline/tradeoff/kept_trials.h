#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "pipeline/tradeoff/tradeoff.h"

namespace eventgan {

/// Part of every key: what is kept by another version of the measurement does not count.
inline constexpr char kKeptVersion[] = "trade-off 2";

/// What is measured, in a folder: FOLDER/kept/KEY.json for each configuration, whole or not there.
/// For one thread at a time.
class KeptTrials {
 public:
  /// Makes the folders. Throws std::runtime_error if it cannot, or FOLDER/kept is a symbolic link.
  explicit KeptTrials(const std::filesystem::path& folder);

  /// Gives `trial` the losses, rounds and real scores that are kept under `key`, if there are any;
  /// what is not the file of this key, or not as it was written (each has a SHA-256 of its
  /// content), counts as none. `save` writes under it.
  void load(Trial& trial, const std::string& key);

  /// Throws std::runtime_error if it cannot be written, std::out_of_range without `load` before.
  void save(const Trial& trial) const;

 private:
  std::filesystem::path folder_;
  std::map<std::string, std::string> keys_;  ///< by the configuration's name
};

}  // namespace eventgan
