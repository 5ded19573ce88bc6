#pragma once

#include <filesystem>
#include <vector>

#include "manifests/values/shard.h"

namespace eventgan::testing {

/// A small shard before it is written.
struct ExampleShard {
  ShardHeader header;
  std::vector<ShardSample> samples;
  std::vector<std::vector<float>> volumes;  ///< as generated; empty for a quarantined sample
};

/// Five samples of 2 x 2 channels, 6 x 8 pixels, from images twice that size, stretched: two
/// boxes (one DontCare) and two persons (the second with everything optional); no labels and an
/// empty volume; quarantined, with only the original; a box that reaches out of the image; one
/// person with nothing annotated.
ExampleShard example_shard(StoredType type = StoredType::kFloat16, int deflate_level = 1);

/// One sample of a source that has no labels at all, not even names.
ExampleShard unlabelled_shard();

/// Encodes, writes and commits the shard; the commit record is returned, not written.
CommitRecord write_shard(const std::filesystem::path& folder, const ExampleShard& example);

}  // namespace eventgan::testing
