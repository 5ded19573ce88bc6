#include "pipeline/conversion/shard_header.h"

#include <cstddef>

#include "pipeline/planning/fingerprint.h"

namespace eventgan {

ShardHeader make_shard_header(const JobManifest& manifest, const PlannedShard& shard,
                              const FrozenPlan& frozen, const LabelSchema& label_schema,
                              const std::string& weights_hash, const std::string& generator) {
  const SourceSpec& source = manifest.sources[static_cast<std::size_t>(shard.source)];
  ShardHeader header;
  header.name = shard.name;
  header.dataset = to_string(source.dataset);
  header.split = source.split;
  header.sample_count = static_cast<int>(shard.samples.size());
  header.volume = {manifest.volume.bins, shard.volume_size};
  header.dtype = manifest.output.dtype;
  header.deflate_level = manifest.output.deflate_level;
  header.normalization = manifest.volume.normalize;
  header.unit = manifest.generator.kind == GeneratorKind::kNetwork ? VolumeUnit::kLearned
                                                                   : VolumeUnit::kEvents;
  header.label_schema = label_schema;
  header.preprocessing = preprocessing_json(manifest.image);
  header.plan_hash = frozen.hash;
  header.manifest_text = frozen.plan.manifest_text;
  header.weights_hash = weights_hash;
  header.generator = generator;
  header.program_version = program_version();
  return header;
}

}  // namespace eventgan
