#include <string>

#include "stages/shards/shard_objects_internal.h"
#include "stages/shards/volume_words_internal.h"

namespace eventgan {
namespace {

constexpr char kVolumePath[] = "/events/volume";

void check_format(hid_t file) {
  const std::string format = read_text_attribute(file, "format");
  if (format != kShardFormat) {
    throw Hdf5Error("expected format " + std::string(kShardFormat) + ", got " + format);
  }
  const int version = read_number_attribute(file, "format_version");
  if (version != kShardFormatVersion) {
    throw Hdf5Error("expected format version " + std::to_string(kShardFormatVersion) + ", got " +
                    std::to_string(version));
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
  for (const VolumeUnit candidate : {VolumeUnit::kLearned, VolumeUnit::kEvents}) {
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

}  // namespace

ShardHeader read_header(hid_t file) {
  check_format(file);
  ShardHeader header;
  header.name = read_text_attribute(file, "name");
  header.dataset = read_text_attribute(file, "dataset");
  header.split = read_text_attribute(file, "split");
  header.plan_hash = read_text_attribute(file, "plan_hash");
  header.manifest_text = read_text_attribute(file, "manifest");
  header.weights_hash = read_text_attribute(file, "weights_hash");
  header.generator = read_text_attribute(file, "generator");
  header.program_version = read_text_attribute(file, "program_version");
  header.preprocessing = read_text_attribute(file, "preprocessing");
  read_volume(file, header);
  header.label_schema.class_names =
      read_texts_attribute(open_object(file, "/labels/boxes/class_id"), "class_names");
  header.label_schema.joint_names =
      read_texts_attribute(open_object(file, "/labels/poses"), "joint_names");
  return header;
}

}  // namespace eventgan
