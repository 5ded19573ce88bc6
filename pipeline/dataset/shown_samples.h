#pragma once

#include <compare>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace eventgan {

/// The shards that a command is to show.
struct ShownShards {
  std::filesystem::path folder;  ///< in which they lie
  std::vector<std::filesystem::path> files;
  std::vector<int> samples;  ///< of each
  std::vector<int> sources;  ///< of each: the manifest's source; 0 for a shard that was given alone
  bool is_folder = false;    ///< all that are done in a folder; else one that was given alone
};

/// Whether `where` stands for all shards of a folder: the folder itself, or its dataset.h5.
bool means_folder(const std::filesystem::path& where);

/// That folder; of anything else the folder that it is in.
std::filesystem::path folder_of_shards(const std::filesystem::path& where);

/// The shards of an output folder that are done, those of its dataset.h5, or the one shard `where`.
/// Throws InputError if there is none; what ShardReader throws.
ShownShards find_shown_shards(const std::filesystem::path& where);

/// A sample by its shard's place in ShownShards.
struct ShownSample {
  std::size_t shard = 0;
  int slot = 0;
  auto operator<=>(const ShownSample&) const = default;
};

/// What --sample takes, for a help text; the rule is that of find_samples.
inline constexpr char kSampleRule[] =
    "by id or, in a single shard, by slot (0, 1, 2, ...); a number that is an id means that id";

/// The samples that `names` name, each once, in the order of shards and slots. A name is an id,
/// which several samples of a folder can have: one of each source. Only a name that is no id is a
/// slot, if the shard was given alone and the name is a number without leading zeros: an id that
/// looks like a number is an id, and a mistyped "000012" is never slot 12. Throws UsageError for a
/// name that is neither; what read_overview throws.
std::vector<ShownSample> find_samples(const ShownShards& shards,
                                      const std::vector<std::string>& names);

}  // namespace eventgan
