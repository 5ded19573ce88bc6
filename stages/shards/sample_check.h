#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/shard.h"

namespace eventgan {

/// What is wrong with the labels of one sample as a shard holds them: a number that is not finite,
/// in any column; a box, joint, centre, scale, head box, person's box, camera or projection that is
/// not what source_to_volume makes of its annotation (more than 0.01 px off); a clipped box that is
/// not the unclipped one cut to the volume; a motion of a pair that is no still's. Texts without
/// the file's name; empty if sound.
std::vector<std::string> label_faults(const ShardHeader& header, const ShardSample& sample);

/// What is wrong with a volume as read back from a shard: values that are not finite or below zero,
/// or that do not agree with the sample's statistics as closely as the stored type allows; values
/// other than zero in the slot of a quarantined sample. Text without the file's name; nothing if
/// sound. Thread safe.
std::optional<std::string> volume_fault(const ShardHeader& header, const ShardSample& sample,
                                        std::span<const float> volume);

}  // namespace eventgan
