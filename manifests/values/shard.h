#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/input_counts.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"

namespace eventgan {

/// What the values of a volume, as generated, are.
enum class VolumeUnit {
  kLearned,  ///< a network's: dimensionless, as the volumes of its training were normalised
  kEvents,   ///< a simulator's: a count of events, each spread over the two bins nearest in time
  kDrawn,    ///< the same of events drawn from a network's rates, between the frames' times
  kRates     ///< a network's: the number of events to be expected
};

/// What is true of a whole shard; manifests/guides/shard_format.md says where each field is.
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
  std::string scope;  ///< "motion"; empty if whole volumes are generated
  int tile_px = 0;    ///< side of the tiles of ShardSample::tiles; 0 if whole ones are
  LabelSchema label_schema;
  std::string format_version;  ///< of a shard that is read, as its writer says it: "1.0"
  /// The same: what it has that not every shard has.
  std::vector<std::string> features;
  std::string preprocessing;  ///< JSON: fit, grey, blur, preset
  std::string plan_hash;      ///< SHA-256 of the frozen plan, hex
  std::string manifest_text;
  /// The weights' name: "shipped:8", "untrained:8", or the file as the manifest has it; empty for a
  /// simulator.
  std::string weights;
  std::string weights_hash;  ///< SHA-256 of the weights (simulators: of `generator`), hex
  std::string generator;     ///< Generator::description()
  std::string program_version;
};

/// One sample but for its volume: one row of everything else in a shard.
struct ShardSample {
  bool valid = true;
  std::string fault;  ///< why not, if not valid; kept in the commit record, not in the shard
  std::string sample_id;
  std::string sequence;
  FrameOrigin origin;
  FramePair pair;
  ImageSize source_size;                     ///< {0, 0} if unknown (quarantined)
  std::array<double, 6> source_to_volume{};  ///< NaN if unknown (quarantined)
  /// The sensor's, if the manifest tells it (pair_threshold) and there is a volume.
  std::optional<double> threshold = {};
  VolumeStatistics statistics;
  /// [row, column] of the volume's tiles: 1 generated, 0 left at zero. Empty: all is generated.
  std::vector<std::uint8_t> tiles;
  float scale = 1;        ///< value = stored code x scale for uint8; 1 for floats
  Annotation annotation;  ///< empty boxes and persons if the annotation could not be read
  VolumeLabels labels;    ///< as many entries as `annotation`
  PixelFlow flow = {};    ///< of the volume's size, in numbers that float16 holds; may be empty
};

/// A sample that a shard keeps a slot for but no volume.
struct QuarantinedSample {
  int slot = 0;
  std::string sample_id;
  std::string reason;
  bool operator==(const QuarantinedSample&) const = default;
};

/// A quarantined sample and the shard it is of.
struct QuarantinedSlot {
  std::string shard;  ///< the shard's file name
  int slot = 0;
  std::string sample_id;
  std::string reason;
};

/// What a shard holds, quarantined samples included: with this a whole dataset can be laid out, and
/// its offsets follow, from the commit records alone.
struct ShardContents {
  std::vector<std::int32_t> boxes;              ///< rows of /labels/boxes by slot
  std::vector<std::int32_t> persons;            ///< rows of /labels/poses by slot
  std::map<std::string, std::int64_t> classes;  ///< boxes by class name; only names that occur
  std::map<int, std::int64_t> gaps;             ///< samples by gap in frames
  std::vector<std::string> optional_columns;    ///< paths, in the order of the columns
  bool operator==(const ShardContents&) const = default;
};

/// The file SHARD.json beside a shard: written after the shard is whole and in place, so its
/// existence is what says "done". A shard is done if its commit record parses, names
/// the plan, and the shard has the commit record's size.
struct CommitRecord {
  std::string shard;      ///< the shard's file name
  std::string plan_hash;  ///< hex SHA-256
  std::string sha256;     ///< of the shard's bytes, hex
  std::int64_t size_bytes = 0;
  int samples = 0;
  int valid = 0;
  std::vector<QuarantinedSample> quarantined;
  ShardContents contents;
  InputCounts inputs = {};                      ///< of the valid samples
  std::map<std::string, double> stage_seconds;  ///< busy time by stage
  double wall_seconds = 0;  ///< since the writer's previous commit, or the start of its run
  /// Most memory of the writer's process up to the commit; 0: not known.
  std::int64_t peak_bytes = 0;
  /// Places in the file that this program does not know, of a later minor version; not written.
  std::set<std::string> unknown = {};
  bool operator==(const CommitRecord&) const = default;
};

}  // namespace eventgan
