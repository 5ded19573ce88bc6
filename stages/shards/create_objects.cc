#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

#include "stages/shards/codec/quantization.h"
#include "stages/shards/shard_objects_internal.h"
#include "stages/shards/volume_words_internal.h"

namespace eventgan {
namespace {

constexpr char kVolumePath[] = "/events/volume";

/// IEEE 754 binary16, which HDF5 1.10 has no name for.
Hdf5Handle half_type() {
  Hdf5Handle type = number_type(4, true, true);
  checked(H5Tset_fields(type, 15, 10, 5, 0, 10), "make", "float16");
  checked(H5Tset_size(type, 2), "make", "float16");
  checked(H5Tset_ebias(type, 15), "make", "float16");
  return type;
}

void write_root_attributes(hid_t file, const ShardHeader& header) {
  write_attribute(file, "format", std::string(kShardFormat));
  write_attribute(file, "format_version", std::int32_t{kShardFormatVersion});
  write_attribute(file, "name", header.name);
  write_attribute(file, "dataset", header.dataset);
  write_attribute(file, "split", header.split);
  describe_origin(file, header);
}

Hdf5Handle create_volume(hid_t file, const ShardHeader& header) {
  const Dims dims{static_cast<hsize_t>(header.sample_count),
                  static_cast<hsize_t>(header.volume.channels()),
                  static_cast<hsize_t>(header.volume.size.height),
                  static_cast<hsize_t>(header.volume.size.width)};
  const Dims chunk{1, dims[1], dims[2], dims[3]};
  const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
  set_chunks(creation, chunk, kVolumePath);
  set_filters(creation, header.deflate_level, kVolumePath);
  // HDF5's default fill value is zero and its default is to allocate no chunk before it is written:
  // that is how the slots of quarantined samples read as zeros.
  return create_dataset(file, kVolumePath, volume_type(header.dtype), space_of(dims, kVolumePath),
                        creation);
}

}  // namespace

std::size_t stored_volume_size(const ShardHeader& header) {
  const VolumeShape& shape = header.volume;
  const std::size_t size = shape.value_count() * stored_size(header.dtype);
  if (header.sample_count < 1 || shape.bins < 1 || shape.size.height < 1 || shape.size.width < 1) {
    throw std::invalid_argument("expected samples and a volume with values, in " + header.name);
  }
  if (size > std::numeric_limits<std::uint32_t>::max()) {
    throw std::invalid_argument("expected volumes below 4 GiB, got " + std::to_string(size) +
                                " bytes, in " + header.name);
  }
  return size;
}

Hdf5Handle volume_type(StoredType type) {
  switch (type) {
    case StoredType::kFloat32:
      return number_type(4, true, true);
    case StoredType::kFloat16:
      return half_type();
    case StoredType::kUint8:
      return number_type(1, false, false);
  }
  throw std::logic_error("unknown stored type");
}

void describe_origin(hid_t object, const ShardHeader& header) {
  write_attribute(object, "plan_hash", header.plan_hash);
  write_attribute(object, "manifest", header.manifest_text);
  write_attribute(object, "weights_hash", header.weights_hash);
  write_attribute(object, "generator", header.generator);
  write_attribute(object, "program_version", header.program_version);
  write_attribute(object, "preprocessing", header.preprocessing);
}

void create_groups(hid_t location) {
  for (const char* path :
       {"events", "events/statistics", "pairs", "labels", "labels/boxes", "labels/poses"}) {
    create_group(location, path).close(path);
  }
}

void describe_volume(hid_t volume, const ShardHeader& header) {
  const int bins = header.volume.bins;
  write_attribute(volume, "axes", std::string("sample, channel, y, x"));
  write_attribute(volume, "bins", std::int32_t{bins});
  write_attribute(volume, "channel_order",
                  "channels 0.." + std::to_string(bins - 1) + ": positive polarity, channels " +
                      std::to_string(bins) + ".." + std::to_string(2 * bins - 1) +
                      ": negative; each in time order");
  write_attribute(volume, "time_axis", time_axis_text(header.unit));
  write_attribute(volume, "normalization", std::string(to_string(header.normalization)));
  write_attribute(volume, "unit", unit_text(header.unit, header.normalization));
  write_attribute(volume, "scale",
                  header.dtype == StoredType::kUint8
                      ? std::string("value = stored number x /events/scale[sample]")
                      : std::string("value = stored number"));
}

Hdf5Handle create_objects(hid_t file, const ShardHeader& header) {
  write_root_attributes(file, header);
  create_groups(file);
  Hdf5Handle volume = create_volume(file, header);
  describe_volume(volume, header);
  return volume;
}

void describe_columns(hid_t location, const ShardHeader& header) {
  const LabelSchema& schema = header.label_schema;
  write_attribute(open_object(location, "labels/boxes/class_id"), "class_names",
                  schema.class_names);
  write_attribute(open_object(location, "labels/poses"), "joint_names", schema.joint_names);
  write_attribute(open_object(location, "labels/poses/joints"), "joint_names", schema.joint_names);
  write_attribute(open_object(location, "events/statistics/flags"), "bits",
                  std::vector<std::string>{"empty", "extrapolated", "saturated", "vanished"});
  write_attribute(open_object(location, "pairs/source_to_volume"), "meaning",
                  std::string("M with [x', y'] = M [x, y, 1], from a point in pixels of the source "
                              "picture to one in the volume; pixel centres are whole numbers"));
}

}  // namespace eventgan
