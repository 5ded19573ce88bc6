#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/labels.h"
#include "manifests/pairs.h"
#include "manifests/volume.h"
#include "manifests/volume_labels.h"

namespace eventgan {

inline constexpr char kShardFormat[] = "eventgan-shard";
inline constexpr int kShardFormatVersion = 1;

/// What the values of a volume, as generated, are.
enum class VolumeUnit {
  kLearned,  ///< a network's: dimensionless, as the volumes of its training were normalised
  kEvents    ///< a simulator's: a count of events, each spread over the two bins nearest in time
};

/// What is true of a whole shard; manifests/guides/shard_format.md says where each field stands.
struct ShardHeader {
  std::string name;  ///< file name: NAME-SPLIT-00012-of-01024.h5
  std::string dataset;
  std::string split;
  int sample_count = 0;
  VolumeShape volume;
  StoredType dtype = StoredType::kFloat16;
  int deflate_level = 1;
  Normalization normalization = Normalization::kNone;
  VolumeUnit unit = VolumeUnit::kLearned;
  LabelSchema label_schema;
  std::string preprocessing;  ///< JSON: fit, grey, blur, preset
  std::string plan_hash;      ///< SHA-256 of the frozen plan, hex
  std::string manifest_text;
  std::string weights_hash;  ///< SHA-256 of the weights (simulators: of `generator`), hex
  std::string generator;     ///< Generator::description()
  std::string program_version;
};

/// One sample but for its volume: one row of everything else in a shard.
struct ShardSample {
  bool valid = true;
  std::string fault;  ///< why not, if not valid; kept in the marker, not in the shard
  std::string sample_id;
  std::string sequence;
  FramePair pair;
  ImageSize source_size;                     ///< {0, 0} if unknown (quarantined)
  std::array<double, 6> source_to_volume{};  ///< NaN if unknown (quarantined)
  VolumeStatistics statistics;
  float scale = 1;        ///< value = stored code x scale for uint8; 1 for floats
  Annotation annotation;  ///< empty boxes and persons if the annotation could not be read
  VolumeLabels labels;    ///< as many entries as `annotation`
};

}  // namespace eventgan
