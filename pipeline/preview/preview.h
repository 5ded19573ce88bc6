#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stages/shards/shard_reader.h"

namespace eventgan {

struct PreviewOptions {
  std::filesystem::path out;  ///< folder for the images, created if absent
  /// Which samples, the first of these that is given: slots such as "0,3-5", of a single shard;
  /// those with some names, as find_samples has them; of those that are valid the `worst` emptiest,
  /// fullest and farthest beyond the gaps that the generator was trained on; `count` spread over
  /// all.
  std::string slots;
  std::vector<std::string> samples;
  int worst = 0;
  std::optional<int> count;  ///< none: 8, of a sheet 24
  std::string class_name;    ///< only samples with a box of it; empty: any
  /// One image with all of them in small; or an MP4 of the sequence that the first of them is of
  /// (none chosen: of the longest), its labelled frames in order, of each the pair with the
  /// smallest gap.
  bool sheet = false;
  bool video = false;
  std::filesystem::path frames;  ///< the manifest's folder, where frame paths start; empty: as
                                 ///< recorded beside the shards
};

/// Draws samples (see draw_preview) of a folder that convert has written, its dataset.h5, or one
/// shard: SHARD_SLOT.png for each, sheet.png, or SEQUENCE.mp4; quarantined samples without events.
/// Returns what it wrote. `warnings` gets a line for each sample whose frames could not be shown.
///
/// Of a folder every shard that is done counts, and of those that no sample is chosen from only the
/// overview is read. Throws InputError if there is no shard or no valid sample to choose from,
/// UsageError for slots, names or a class that none has; what ShardReader throws.
std::vector<std::filesystem::path> preview(const std::filesystem::path& where,
                                           const PreviewOptions& options,
                                           std::vector<std::string>& warnings);

/// Slots named by text such as "0,3-5": {0, 3, 4, 5}; ascending, each once. Throws UsageError for
/// anything else, or a slot that a shard of `sample_count` samples does not have.
std::vector<int> parse_slots(const std::string& text, int sample_count);

/// The kinds of samples that are worth a look first.
enum class Extreme { kEmptiest, kFullest, kExtrapolated };

/// Ranks a valid sample of an overview: the largest is the most extreme. Emptiest and fullest go by
/// the volume's sum a pixel; only samples with kFlagExtrapolated or kFlagBeyondCalibration are
/// extrapolated, by their gap. None for a sample that is not of the kind, or not valid.
std::optional<double> rank(Extreme extreme, const ShardOverview& shard, int slot);

}  // namespace eventgan
