#include "pipeline/conversion/shard_sink.h"

#include <fmt/core.h>

#include <array>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/files/atomic_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/runtime/memory.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/runtime/trace.h"
#include "stages/generator/shipped_weights.h"

namespace eventgan {
namespace {

VolumeUnit unit_of(const GeneratorSpec& spec, const Generator& generator) {
  if (!has_weights(spec.kind)) return VolumeUnit::kEvents;
  if (!generator.thresholds()) return VolumeUnit::kLearned;
  return spec.sample ? VolumeUnit::kDrawn : VolumeUnit::kRates;
}

std::string range_text(const std::array<double, 2>& range) {
  return range[0] == range[1] ? fmt::format("{:.4g}", range[0])
                              : fmt::format("{:.4g}..{:.4g}", range[0], range[1]);
}

/// What the manifest tells of the sensor, for people: all of it is in manifest_text.
std::string sensor_text(const GeneratorSpec& spec) {
  if (!spec.camera.empty()) return ", sensor " + spec.camera;
  std::string text;
  if (spec.threshold) text += ", threshold " + range_text(spec.threshold->range);
  if (spec.noise) {
    text += fmt::format(", noise of shot_hz {}, leak_hz {}, hot_pixels {}",
                        range_text(spec.noise->shot_hz), range_text(spec.noise->leak_hz),
                        range_text(spec.noise->hot_pixels));
  }
  return text;
}

ShardHeader header_of(const PlannedShard& shard, const ConversionJob& job) {
  const JobManifest& manifest = job.manifest;
  const auto source = static_cast<std::size_t>(shard.source);
  ShardHeader header;
  header.name = shard.name;
  header.dataset = to_string(manifest.sources[source].dataset);
  header.split = manifest.sources[source].split;
  header.sample_count = static_cast<int>(shard.samples.size());
  header.volume = {manifest.volume.bins, shard.volume_size};
  header.dtype = manifest.output.dtype;
  header.deflate_level = manifest.output.deflate_level;
  header.normalization = manifest.volume.normalize;
  header.unit = unit_of(manifest.generator, job.generator);
  header.label_schema = job.datasets[source]->label_schema();
  header.preprocessing = preprocessing_json(manifest.image);
  header.plan_hash = job.frozen.hash;
  header.manifest_text = job.frozen.plan.manifest_text;
  if (has_weights(manifest.generator.kind)) {
    header.weights = shipped_weights_name(manifest.generator.weights);
  }
  if (const ScopeSpec& scope = manifest.generator.scope; scope.scope != Scope::kWhole) {
    header.scope = to_string(scope.scope);
    header.tile_px = scope.tile_px;
  }
  header.weights_hash = job.weights_hash;
  header.generator = job.generator.description() + sensor_text(manifest.generator);
  header.program_version = program_version();
  return header;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Counts the calling thread's work since `start_ns` (thread_processor_ns) as the stage "write".
void add_write_seconds(std::int64_t start_ns, CommitRecord& record) {
  record.stage_seconds[kStageNames[static_cast<std::size_t>(Stage::kWrite)]] +=
      1e-9 * static_cast<double>(thread_processor_ns() - start_ns);
}

}  // namespace

ShardSink::ShardSink(const ConversionJob& job, SharedFolder& shared,
                     std::int64_t quarantined_before)
    : job_(job),
      shared_(shared),
      quarantined_(quarantined_before),
      committed_at_(std::chrono::steady_clock::now()) {}

bool ShardSink::closed() const {
  return beyond_limits(job_.manifest.errors, quarantined_, job_.frozen.plan.sample_count());
}

void ShardSink::open(const PlannedShard& shard) {
  TraceSpan span(job_.options.trace, "open shard", "shard");
  span.note("shard", shard.name);
  const std::int64_t start_ns = thread_processor_ns();
  writer_ = std::make_unique<ShardWriter>(job_.folder, header_of(shard, job_));
  shard_ = &shard;
  record_ = {};
  record_.shard = shard.name;
  record_.plan_hash = job_.frozen.hash;
  add_write_seconds(start_ns, record_);
}

void ShardSink::add(const SampleMessage& message) {
  if (message.failed() && job_.manifest.errors.policy == ErrorPolicy::kFail) {
    throw TooManyFaults("errors.policy is \"fail\": " + message.sample.fault);
  }
  const std::int64_t start_ns = thread_processor_ns();
  writer_->append(message.sample, message.chunk);
  ++record_.samples;
  if (message.failed()) {
    record_.quarantined.push_back({message.slot, message.sample.sample_id, message.sample.fault});
  } else {
    ++record_.valid;
    record_.inputs += message.input_counts();
  }
  for (std::size_t stage = 0; stage < kStageCount; ++stage) {
    record_.stage_seconds[kStageNames[stage]] += message.seconds[stage];
  }
  shared_.tell(*shard_, record_.samples);
  add_write_seconds(start_ns, record_);
}

bool ShardSink::commit() {
  TraceSpan span(job_.options.trace, "commit shard", "shard");
  span.note("shard", shard_->name);
  span.note("samples", record_.samples);
  const std::int64_t start_ns = thread_processor_ns();
  if (outdate_dataset(job_.folder, shard_->name) && job_.options.warn) {
    job_.options.warn("dataset.json and dataset.h5 described " + shard_->name +
                      " as it was and are removed until all shards are done");
  }
  ShardReceipt receipt;
  try {
    const TraceSpan file(job_.options.trace, "close, fsync, hash, rename", "shard");
    receipt = writer_->commit();
  } catch (const UnfinishedShardLost&) {
    if (!shared_.is_done(*shard_)) throw;
    abandon();
    return false;
  }
  writer_.reset();
  record_.sha256 = receipt.sha256;
  record_.size_bytes = receipt.size_bytes;
  span.note("bytes", receipt.size_bytes);
  record_.contents = std::move(receipt.contents);
  add_write_seconds(start_ns, record_);
  record_.wall_seconds = seconds_since(committed_at_);
  record_.peak_bytes = static_cast<std::int64_t>(peak_memory_bytes());
  {
    const TraceSpan file(job_.options.trace, "write commit record", "shard");
    write_file_atomically(job_.folder / commit_record_name(shard_->name), to_json(record_));
  }
  shared_.release(*shard_);
  committed_at_ = std::chrono::steady_clock::now();
  quarantined_ += std::ssize(record_.quarantined);
  committed_.push_back({shard_, std::move(record_)});
  return true;
}

void ShardSink::abandon() {
  if (writer_) shared_.release(*shard_);
  writer_.reset();
}

}  // namespace eventgan
