#pragma once

#include <string>
#include <vector>

#include "manifests/image_size.h"
#include "manifests/plan.h"

namespace eventgan {

/// Samples of one source, each with the size its volume will have.
struct SizedSamples {
  int source = 0;
  std::string split;
  std::vector<PlannedSample> samples;
  std::vector<ImageSize>
      volume_sizes;  ///< one for each sample; {0, 0} if the picture could not be read
};

/// Lays samples into shards of at most `samples_per_shard`: a shard holds one source and one size,
/// samples keep their order, sizes come in the order of their first sample. A sample of unknown
/// size joins the size most samples of its source have (where none is known: 1x1), since it will be
/// quarantined anyway. Shards are numbered within their split, over all sources.
std::vector<PlannedShard> lay_out_shards(const std::string& name, std::vector<SizedSamples> sources,
                                         int samples_per_shard);

}  // namespace eventgan
