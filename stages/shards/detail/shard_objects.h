#pragma once

#include <string>

#include "manifests/documents/format_version.h"
#include "manifests/values/shard.h"
#include "stages/base/hdf5/hdf5.h"

namespace eventgan {

inline constexpr char kShardFormat[] = "eventgan-shard";
inline constexpr FormatVersion kShardFormatVersion{1, 0};

inline constexpr char kVolumePath[] = "/events/volume";

// What the attributes of /events/volume say in words.

/// One text for each unit and normalisation, so that it can be read back.
std::string unit_text(VolumeUnit unit, Normalization normalization);

std::string time_axis_text(VolumeUnit unit);

// The objects of a shard that are not columns: root attributes, groups, the volume dataset, and the
// attributes that explain. All throw Hdf5Error.

/// Bytes of one volume as stored, before compression. Throws std::invalid_argument if HDF5 has no
/// chunks that large (4 GiB), or the shape is empty.
std::size_t stored_volume_size(const ShardHeader& header);

/// The type of `/events/volume`.
Hdf5Handle volume_type(StoredType type);

/// Everything that is known before the first sample. Returns the open dataset `/events/volume`.
Hdf5Handle create_objects(hid_t file, const ShardHeader& header);

/// Attributes of the columns below `location` (a shard, or a group built like one), and its
/// `features`, once these are written. `optional_columns`: those that are there.
void describe_columns(hid_t location, const ShardHeader& header,
                      const std::vector<std::string>& optional_columns);

// Parts of create_objects that a view of many shards shares with a shard.

/// Attributes that are the same for all shards of a plan.
void describe_origin(hid_t object, const ShardHeader& header);

/// The groups that hold the columns, below `location`.
void create_groups(hid_t location);

/// Attributes of the open dataset `events/volume`.
void describe_volume(hid_t volume, const ShardHeader& header);

/// The header again. Features that this program does not know are named on standard error, each
/// once a process. Throws also if the format is not ours, or its version another major.
ShardHeader read_header(hid_t file);

}  // namespace eventgan
