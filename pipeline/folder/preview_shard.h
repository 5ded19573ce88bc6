#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan {

struct PreviewOptions {
  std::filesystem::path out;  ///< folder for the pictures, created if absent
  std::string samples;        ///< slots such as "0,3-5"; empty: `count` slots spread over the shard
  int count = 8;
  std::filesystem::path frames;  ///< the manifest's folder, where frame paths start; empty: as
                                 ///< recorded beside the shard
};

/// Writes SHARD_SLOT.png for each chosen sample (see write_preview_png) and returns what it wrote.
/// `warnings` gets a line for each sample whose frames could not be shown; quarantined samples have
/// a picture without events.
std::vector<std::filesystem::path> preview_shard(const std::filesystem::path& shard,
                                                 const PreviewOptions& options,
                                                 std::vector<std::string>& warnings);

/// Slots named by text such as "0,3-5": {0, 3, 4, 5}; ascending, each once. Throws UsageError for
/// anything else, or a slot that a shard of `sample_count` samples does not have.
std::vector<int> parse_slots(const std::string& text, int sample_count);

/// `count` slots spread evenly over a shard, the first included.
std::vector<int> spread_slots(int count, int sample_count);

}  // namespace eventgan
