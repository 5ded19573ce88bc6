#include "pipeline/calibration/calibrate.h"

#include <utility>

#include "manifests/faults.h"
#include "manifests/volume.h"
#include "pipeline/calibration/calibration_samples.h"
#include "pipeline/calibration/volume_distance.h"
#include "pipeline/generation/engine_support.h"
#include "pipeline/samples/sample_stages.h"
#include "stages/files/sha256.h"
#include "stages/generator/calibration/calibration.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/torch/calibrator.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {
namespace {

/// Shows progress and obeys a request to stop, pair by pair.
class Watch {
 public:
  Watch(const CalibrationOptions& options, std::int64_t total)
      : options_(options),
        progress_(options.make_progress ? options.make_progress(total) : nullptr) {}

  void before_pair() const {
    if (options_.stop_requested && options_.stop_requested()) {
      throw Stopped("asked to stop while calibrating; nothing is written");
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

std::vector<float> volume_of(const Generator& generator, const PreparedPair& pair) {
  std::vector<float> volume(VolumeShape{generator.bins(), pair.content}.value_count());
  generator.generate(pair.input, pair.content, volume);
  return volume;
}

std::string origin_text(const JobManifest& manifest) {
  return manifest.name + ", manifest SHA-256 " + sha256_hex(manifest.text);
}

/// Reads the samples; what is not held out goes into the calibrator. Returns the held-out pairs.
std::vector<PreparedPair> collect(const SampleStages& stages,
                                  const std::vector<CalibrationSample>& samples, const Watch& watch,
                                  Calibrator& calibrator, std::vector<std::string>& skipped) {
  std::vector<PreparedPair> held_out;
  for (const CalibrationSample& sample : samples) {
    watch.before_pair();
    SampleMessage message;
    message.shard = sample.shard;
    message.slot = sample.slot;
    stages.read(message);
    if (message.failed()) {
      skipped.push_back(sample.planned().sample_id + ": " + message.sample.fault);
      watch.after_pair(/*skipped=*/true);
    } else if (sample.held_out) {
      held_out.push_back(std::move(message.prepared));
    } else {
      calibrator.add(message.prepared.input, message.prepared.content);
      watch.after_pair(/*skipped=*/false);
    }
  }
  return held_out;
}

std::vector<double> int8_distances(const Generator& int8, const Generator& reference,
                                   const std::vector<PreparedPair>& pairs, const Watch& watch) {
  std::vector<double> distances;
  for (const PreparedPair& pair : pairs) {
    watch.before_pair();
    distances.push_back(relative_distance(volume_of(int8, pair), volume_of(reference, pair)));
    watch.after_pair(/*skipped=*/false);
  }
  return distances;
}

/// Pairs that were read to be measured, and are not.
void leave(const std::vector<PreparedPair>& pairs, const Watch& watch) {
  for (std::size_t i = 0; i < pairs.size(); ++i) watch.after_pair(/*skipped=*/false);
}

/// What stands between this program, on this processor, and int8; empty if nothing does.
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
  const std::unique_ptr<Generator> reference = make_torch_generator(weights);
  const SampleStages stages(manifest, job.datasets, *reference, /*in_flight=*/1);
  Calibrator calibrator(weights);
  CalibrationOutcome outcome;
  const std::vector<PreparedPair> held_out =
      collect(stages, samples, watch, calibrator, outcome.skipped);
  if (calibrator.pairs() == 0) {
    throw InputError("expected pairs to calibrate on, got none that can be read of " +
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

}  // namespace eventgan
