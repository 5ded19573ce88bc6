#pragma once

#include <string>
#include <vector>

#include "manifests/shard.h"

namespace eventgan {

/// What is wrong with the labels of one sample as a shard holds them: a number that is not finite,
/// in any column; a box, joint, centre or head box that is not where source_to_volume puts its
/// annotation (more than 0.01 px off); a clipped box that is not the unclipped one cut to the
/// volume. Texts without the file's name; empty if sound.
std::vector<std::string> label_faults(const ShardHeader& header, const ShardSample& sample);

}  // namespace eventgan
