#include "pipeline/generators/calibrate.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/sha256.h"
#include "manifests/values/events.h"
#include "manifests/values/faults.h"
#include "manifests/values/pair_key.h"
#include "manifests/values/weights.h"
#include "pipeline/conversion/sample_stages.h"
#include "pipeline/generators/choose_engine.h"
#include "stages/generator/calibration.h"
#include "stages/generator/onednn/calibrator.h"
#include "stages/generator/onednn/onednn_generator.h"

namespace eventgan {
namespace {

constexpr std::int64_t kLeastShareToCalibrate = 4;  // for each sample that is held out

std::int64_t sound_count(const Plan& plan) {
  std::int64_t count = 0;
  for (const PlannedShard& shard : plan.shards) {
    count += std::ranges::count_if(
        shard.samples, [](const PlannedSample& sample) { return sample.fault.empty(); });
  }
  return count;
}

}  // namespace

std::vector<CalibrationSample> choose_calibration_samples(const Plan& plan, int pairs,
                                                          int held_out) {
  const std::int64_t sound = sound_count(plan);
  const std::int64_t held = std::min<std::int64_t>(held_out, sound / (kLeastShareToCalibrate + 1));
  const std::int64_t chosen = held + std::min<std::int64_t>(pairs, sound - held);
  std::vector<CalibrationSample> samples;
  std::int64_t number = 0;  // among the sound ones
  for (const PlannedShard& shard : plan.shards) {
    for (std::size_t slot = 0; slot < shard.samples.size(); ++slot) {
      if (!shard.samples[slot].fault.empty()) continue;
      const std::int64_t k = std::ssize(samples);
      if (k < chosen && number++ == k * sound / chosen) {
        const bool is_held_out = (k + 1) * held / chosen > k * held / chosen;
        samples.push_back({&shard, static_cast<int>(slot), is_held_out});
      }
    }
  }
  return samples;
}

double relative_distance(std::span<const float> volume, std::span<const float> reference) {
  double difference = 0;
  double whole = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const double r = reference[i];
    const double d = volume[i] - r;
    difference += d * d;
    whole += r * r;
  }
  if (whole > 0) return std::sqrt(difference / whole);
  return difference == 0 ? 0 : std::numeric_limits<double>::infinity();
}

namespace {

/// Shows progress and obeys a request to stop, pair by pair.
class Watch {
 public:
  Watch(const CalibrationOptions& options, std::int64_t total)
      : options_(options),
        progress_(options.make_progress ? options.make_progress(total) : nullptr) {}

  void before_pair() const {
    if (options_.stop_requested && options_.stop_requested()) {
      throw Stopped("stopped on request; nothing was written");
    }
  }
  void after_pair(bool skipped) const {
    if (progress_) progress_->advance(skipped, 0);
  }
  void finish() const {
    if (progress_) progress_->finish();
  }

 private:
  const CalibrationOptions& options_;
  std::unique_ptr<Progress> progress_;
};

/// A pair with the sensor that the manifest tells for it.
struct ToldPair {
  PreparedPair prepared;
  std::optional<ContrastThreshold> threshold;

  GeneratorInput input() const { return {prepared.input, prepared.content, threshold}; }
};

std::vector<float> volume_of(const Generator& generator, const ToldPair& pair) {
  std::vector<float> volume(VolumeShape{generator.bins(), pair.prepared.content}.value_count());
  generator.generate(pair.input(), volume);
  return volume;
}

std::string origin_text(const JobManifest& manifest) {
  return manifest.name + ", manifest SHA-256 " + sha256_hex(manifest.text);
}

/// Reads the samples; what is not held out goes into the calibrator. Returns the held-out pairs.
std::vector<ToldPair> collect(const JobManifest& manifest, const SampleStages& stages,
                              const std::vector<CalibrationSample>& samples, const Watch& watch,
                              Calibrator& calibrator, std::vector<std::string>& skipped) {
  std::vector<ToldPair> held_out;
  for (const CalibrationSample& sample : samples) {
    watch.before_pair();
    SampleMessage message;
    message.shard = sample.shard;
    message.slot = sample.slot;
    stages.read(message);
    if (message.failed()) {
      skipped.push_back(sample.planned().sample_id + ": " + message.sample.fault);
      watch.after_pair(/*skipped=*/true);
      continue;
    }
    const auto source = static_cast<std::size_t>(sample.shard->source);
    const std::string of_source = source_key(manifest.sources, source);
    const PairKey key{manifest.seed, to_string(manifest.sources[source].dataset),
                      message.sample.sample_id, of_source};
    ToldPair pair{std::move(message.prepared), pair_threshold(manifest.generator, key)};
    if (sample.held_out) {
      held_out.push_back(std::move(pair));
    } else {
      calibrator.add(pair.input());
      watch.after_pair(/*skipped=*/false);
    }
  }
  return held_out;
}

std::vector<double> int8_distances(const Generator& int8, const Generator& reference,
                                   const std::vector<ToldPair>& pairs, const Watch& watch) {
  std::vector<double> distances;
  for (const ToldPair& pair : pairs) {
    watch.before_pair();
    distances.push_back(relative_distance(volume_of(int8, pair), volume_of(reference, pair)));
    watch.after_pair(/*skipped=*/false);
  }
  return distances;
}

/// Pairs that were read to be measured, and are not.
void leave(const std::vector<ToldPair>& pairs, const Watch& watch) {
  for (std::size_t i = 0; i < pairs.size(); ++i) watch.after_pair(/*skipped=*/false);
}

/// What is between this program, on this processor, and int8; empty if nothing does.
std::string int8_lack() {
  const EngineSupport support = engine_support(Precision::kInt8);
  if (support.onednn_able) return "";
  return support.onednn_built ? "this processor (" + support.processor + ") cannot compute int8"
                              : "this program was built without oneDNN";
}

}  // namespace

CalibrationOutcome calibrate(const JobManifest& manifest, const PlannedJob& job,
                             const Weights& weights, const CalibrationOptions& options) {
  const std::vector<CalibrationSample> samples =
      choose_calibration_samples(job.plan, options.pairs, options.held_out);
  const Watch watch(options, std::ssize(samples));
  const std::unique_ptr<Generator> reference = make_onednn_generator(weights, Precision::kFloat32);
  const SampleStages stages(manifest, job.datasets, *reference, /*in_flight=*/1);
  Calibrator calibrator(weights);
  CalibrationOutcome outcome;
  const std::vector<ToldPair> held_out =
      collect(manifest, stages, samples, watch, calibrator, outcome.skipped);
  if (calibrator.pairs() == 0) {
    throw InputError("expected readable pairs to calibrate on, got none of " +
                     std::to_string(samples.size()) + ", in " + manifest.name +
                     (outcome.skipped.empty() ? "" : "\n  " + outcome.skipped.front()));
  }
  outcome.weights = weights;
  outcome.weights.calibration =
      std::make_shared<Calibration>(calibrator.calibration(origin_text(manifest)));
  outcome.unmeasured = int8_lack();
  if (!outcome.unmeasured.empty()) {
    leave(held_out, watch);
  } else if (!held_out.empty()) {
    const auto int8 = make_onednn_generator(outcome.weights, Precision::kInt8);
    outcome.distances = int8_distances(*int8, *reference, held_out, watch);
  }
  watch.finish();
  return outcome;
}

namespace {

namespace fs = std::filesystem;

constexpr char kExtension[] = ".safetensors";
constexpr char kMark[] = "-calibrated";

fs::path given(const std::string& out) {
  if (!out.ends_with(kExtension)) {
    throw UsageError("--out: expected a file named *.safetensors, got \"" + out + "\"");
  }
  const fs::path file = fs::absolute(out);
  if (!fs::is_directory(file.parent_path())) {
    throw UsageError("--out: expected a file in an existing folder, got \"" + out + "\"");
  }
  return file;
}

}  // namespace

fs::path calibrated_file(const JobManifest& manifest, int base_channels,
                         const std::optional<std::string>& out) {
  if (out) return given(*out);
  const WeightsName name = parse_weights_name(manifest.generator.weights).value();
  const std::string width = name.width == kSensorWeights ? "sensor" : std::to_string(base_channels);
  if (name.origin != WeightsOrigin::kFile) {
    const bool is_shipped = name.origin == WeightsOrigin::kShipped;
    return manifest.directory /
           ((is_shipped ? "eventgan-" : "untrained-") + width + kMark + kExtension);
  }
  const std::string stem = fs::path(name.path).stem().string();
  const bool is_marked = stem.ends_with(kMark);
  const fs::path file = manifest.directory / (stem + (is_marked ? "" : kMark) + kExtension);
  std::error_code absent;
  if (fs::equivalent(file, resolve(manifest, name.path), absent)) {
    throw UsageError("--out: expected a file for the new calibration, got none, and the default, " +
                     file.string() + ", is the file to calibrate");
  }
  return file;
}

std::string calibrated_generator_line(const JobManifest& manifest, const fs::path& file) {
  fs::path shown = file.lexically_relative(manifest.directory);
  if (shown.empty() || *shown.begin() == "..") shown = file;
  return "\"generator\": { \"weights\": " + dump_json(nlohmann::json(shown.generic_string())) +
         ", \"precision\": \"int8\" }";
}

}  // namespace eventgan
