#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "manifests/values/shard.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// What the volume shows of the sample's image, in volume pixels: not the borders of a letterbox,
/// nor what a crop or a still's motion cuts away.
Rectangle shown_area(const ShardSample& sample, ImageSize volume);

/// What is wrong with the labels of the sample in `slot`, which `sample` is, by the rules of the
/// columns (ColumnSpec): a number that is not finite; what is not as source_to_volume makes it of
/// its annotation (more than 0.01 px off); a clipped box that is not the unclipped one cut to the
/// shown_area; an outline that is no outline's text, or lies apart from its box; a motion of a pair
/// that is no still's. Texts without the file's name; empty if sound.
std::vector<std::string> label_faults(const ShardHeader& header, const ShardTables& tables,
                                      int slot, const ShardSample& sample);

/// What is wrong with a volume as read back from a shard: values that are not finite or below zero,
/// or that do not agree with the sample's statistics as closely as the stored type allows; a scale
/// that VolumeCodec does not give to their largest value; values other than zero in the slot of a
/// quarantined sample. Text without the file's name; nothing if sound. Thread safe.
std::optional<std::string> volume_fault(const ShardHeader& header, const ShardSample& sample,
                                        std::span<const float> volume);

}  // namespace eventgan
