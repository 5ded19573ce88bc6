#pragma once

#include <optional>
#include <span>
#include <string>

#include "manifests/shard.h"

namespace eventgan {

/// What is wrong with a volume as read back from a shard: values that are not finite or below zero,
/// or that do not agree with the sample's statistics as closely as the stored type allows; values
/// other than zero in the slot of a quarantined sample. Text without the file's name; nothing if
/// sound. Thread safe.
std::optional<std::string> volume_fault(const ShardHeader& header, const ShardSample& sample,
                                        std::span<const float> volume);

}  // namespace eventgan
