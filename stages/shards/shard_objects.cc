#include "stages/shards/detail/shard_objects.h"

#include <cstdint>
#include <iostream>
#include <limits>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>

#include "manifests/documents/json_text.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/shard_summary.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

std::string unit_text(VolumeUnit unit, Normalization normalization) {
  const bool whole = normalization == Normalization::kNone;
  switch (unit) {
    case VolumeUnit::kLearned:
      return "dimensionless, >= 0; not a count of events";
    case VolumeUnit::kEvents:
      return whole ? "events, >= 0; each spread over the two bins nearest to it in time"
                   : "share of eta98 events, 0..1";
    case VolumeUnit::kDrawn:
      return whole ? "events drawn from a network's rates, >= 0; each spread over the two bins "
                     "nearest to it in time"
                   : "share of eta98 events drawn from a network's rates, 0..1";
    case VolumeUnit::kRates:
      return whole ? "number of events to be expected, >= 0"
                   : "share of eta98 events to be expected, 0..1";
  }
  throw std::logic_error("unknown unit of a volume");
}

std::string time_axis_text(VolumeUnit unit) {
  const std::string bins = "bin b of a polarity is centred at time b / (bins - 1), where 0 is the ";
  return bins + (unit == VolumeUnit::kEvents ? "first event and 1 the last one"
                                             : "previous frame and 1 the next one");
}

namespace {

void write_root_attributes(hid_t file, const ShardHeader& header) {
  write_attribute(file, "format", std::string(kShardFormat));
  write_attribute(file, "format_version", to_string(kShardFormatVersion));
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
      return number_type(2, true, true);
    case StoredType::kUint8:
      return number_type(1, false, false);
  }
  throw std::logic_error("unknown stored type");
}

void describe_origin(hid_t object, const ShardHeader& header) {
  write_attribute(object, "plan_hash", header.plan_hash);
  write_attribute(object, "manifest", header.manifest_text);
  write_attribute(object, "weights_hash", header.weights_hash);
  write_attribute(object, "weights", header.weights);
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

void describe_columns(hid_t location, const ShardHeader& header,
                      const std::vector<std::string>& optional_columns) {
  const LabelSchema& schema = header.label_schema;
  write_attribute(location, "features", features_of(optional_columns, schema));
  write_attribute(open_object(location, "labels/boxes/class_id"), "class_names",
                  schema.class_names);
  write_attribute(open_object(location, "labels/poses"), "joint_names", schema.joint_names);
  write_attribute(open_object(location, "labels/poses/joints"), "joint_names", schema.joint_names);
  if (checked(H5Lexists(location, "events/tiles", H5P_DEFAULT), "look for", "tiles") > 0) {
    const Hdf5Handle tiles = open_object(location, "events/tiles");
    write_attribute(tiles, "tile_px", std::int32_t{header.tile_px});
    write_attribute(tiles, "scope", header.scope);
  }
  if (!schema.joint_aliases.empty()) {
    write_attribute(open_object(location, "labels/poses"), "joint_aliases", schema.joint_aliases);
  }
  write_attribute(open_object(location, "events/statistics/flags"), "bits", flag_names(~0u));
  write_attribute(open_object(location, "pairs/source_to_volume"), "meaning",
                  std::string("M with [x', y'] = M [x, y, 1], from a point in pixels of the source "
                              "image to one in the volume; pixel centres are whole numbers"));
  for (const char* motion : {"pairs/motion", "labels/boxes/motion"}) {
    if (checked(H5Lexists(location, motion, H5P_DEFAULT), "look for", motion) == 0) continue;
    write_attribute(open_object(location, motion), "columns",
                    std::vector<std::string>{"x_px", "y_px", "angle_deg", "scale"});
  }
  if (checked(H5Lexists(location, "labels/flow", H5P_DEFAULT), "look for", "flow") > 0) {
    const Hdf5Handle flow = open_object(location, "labels/flow");
    write_attribute(flow, "meaning",
                    std::string("motion from the pair's previous image to its next one, in pixels "
                                "of the volume, at the pixels of the labelled image: of the next "
                                "one where pairs/label_position is 1, of the previous one where it "
                                "is 0"));
  }
}

namespace {

bool has_attribute(hid_t object, const char* name) {
  return checked(H5Aexists(object, name), "look for", name) > 0;
}

/// The format's version.
std::string check_format(hid_t file) {
  const std::string format = read_text_attribute(file, "format");
  if (format != kShardFormat) {
    throw Hdf5Error("expected format " + std::string(kShardFormat) + ", got " + format);
  }
  const std::string version = read_text_attribute(file, "format_version");
  if (!readable_version(version, kShardFormatVersion)) {
    throw Hdf5Error("expected format_version " + readable_versions(kShardFormatVersion) +
                    ", got \"" + version + "\"");
  }
  return version;
}

void warn_of_features(const ShardHeader& header) {
  static std::mutex lock;
  static std::set<std::string> told;
  const std::lock_guard guard(lock);
  for (const std::string& name : unknown_features(header.features)) {
    if (!told.insert(name).second) continue;
    std::cerr << "warning: " << escape_controls(header.name + ": has \"" + name)
              << "\", which this "
              << "program does not know and leaves out\n";
  }
}

StoredType stored_type(hid_t volume) {
  const Hdf5Handle type(H5Dget_type(volume), H5Tclose, "read", kVolumePath);
  for (const StoredType candidate :
       {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    if (checked(H5Tequal(type, volume_type(candidate)), "read", kVolumePath) > 0) return candidate;
  }
  throw Hdf5Error("expected float32, float16 or uint8 in /events/volume, got another type");
}

int deflate_level(hid_t volume) {
  const Hdf5Handle creation(H5Dget_create_plist(volume), H5Pclose, "read", kVolumePath);
  unsigned level = 0;
  unsigned flags = 0;
  std::size_t count = 1;
  if (H5Pget_filter_by_id2(creation, H5Z_FILTER_DEFLATE, &flags, &count, &level, 0, nullptr,
                           nullptr) < 0) {
    return 0;
  }
  return static_cast<int>(level);
}

Normalization normalization(hid_t volume) {
  const std::string word = read_text_attribute(volume, "normalization");
  for (const Normalization candidate : {Normalization::kNone, Normalization::kEta98}) {
    if (word == to_string(candidate)) return candidate;
  }
  throw Hdf5Error("expected a known normalization, got " + word);
}

VolumeUnit unit(hid_t volume, Normalization normalization) {
  const std::string text = read_text_attribute(volume, "unit");
  for (const VolumeUnit candidate :
       {VolumeUnit::kLearned, VolumeUnit::kEvents, VolumeUnit::kDrawn, VolumeUnit::kRates}) {
    if (text == unit_text(candidate, normalization)) return candidate;
  }
  throw Hdf5Error("expected a known unit, got " + text);
}

void read_volume(hid_t file, ShardHeader& header) {
  const Hdf5Handle volume = open_object(file, kVolumePath);
  header.dtype = stored_type(volume);
  header.deflate_level = deflate_level(volume);
  header.normalization = normalization(volume);
  header.unit = unit(volume, header.normalization);
  header.volume.bins = read_number_attribute(volume, "bins");
  const Dims dims = dims_of(volume, kVolumePath);
  if (dims.size() != 4 || dims[1] != 2 * static_cast<hsize_t>(header.volume.bins)) {
    throw Hdf5Error("expected shape [N, 2 bins, H, W] of /events/volume, got another");
  }
  header.sample_count = static_cast<int>(dims[0]);
  header.volume.size = {static_cast<int>(dims[2]), static_cast<int>(dims[3])};
}

void read_tiles(hid_t file, ShardHeader& header) {
  if (checked(H5Lexists(file, "/events/tiles", H5P_DEFAULT), "look for", "/events/tiles") == 0) {
    return;
  }
  const Hdf5Handle tiles = open_object(file, "/events/tiles");
  header.scope = read_text_attribute(tiles, "scope");
  header.tile_px = read_number_attribute(tiles, "tile_px");
  if (header.tile_px < 1) {
    throw Hdf5Error("expected tile_px of /events/tiles above 0, got " +
                    std::to_string(header.tile_px));
  }
}

}  // namespace

ShardHeader read_header(hid_t file) {
  ShardHeader header;
  header.format_version = check_format(file);
  read_tiles(file, header);
  header.name = read_text_attribute(file, "name");
  header.dataset = read_text_attribute(file, "dataset");
  header.split = read_text_attribute(file, "split");
  header.plan_hash = read_text_attribute(file, "plan_hash");
  header.manifest_text = read_text_attribute(file, "manifest");
  header.weights_hash = read_text_attribute(file, "weights_hash");
  header.weights = read_text_attribute(file, "weights");
  header.generator = read_text_attribute(file, "generator");
  header.program_version = read_text_attribute(file, "program_version");
  header.preprocessing = read_text_attribute(file, "preprocessing");
  read_volume(file, header);
  header.label_schema.class_names =
      read_texts_attribute(open_object(file, "/labels/boxes/class_id"), "class_names");
  header.label_schema.joint_names =
      read_texts_attribute(open_object(file, "/labels/poses"), "joint_names");
  if (const Hdf5Handle poses = open_object(file, "/labels/poses");
      has_attribute(poses, "joint_aliases")) {
    header.label_schema.joint_aliases = read_texts_attribute(poses, "joint_aliases");
  }
  header.features = read_texts_attribute(file, "features");
  warn_of_features(header);
  return header;
}

}  // namespace eventgan
