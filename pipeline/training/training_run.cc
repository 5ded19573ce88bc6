#include "pipeline/training/training_run.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "manifests/faults.h"
#include "manifests/plan.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/training/precision_advice.h"
#include "pipeline/training/records/loss_curves.h"
#include "pipeline/training/records/training_settings.h"
#include "pipeline/training/samples/batch_prefetch.h"
#include "pipeline/training/training_threads.h"
#include "stages/training/learning_rate.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr int kBatchesAhead = 2;
constexpr std::size_t kStepsOfMeans = 100;
constexpr TrainingPhase kPhases[] = {TrainingPhase::kFlow, TrainingPhase::kReconstruction,
                                     TrainingPhase::kGenerator};

std::vector<TrainingRecording> open_all(const TrainingManifest& manifest) {
  const int smallest_gap = *std::min_element(manifest.gaps.begin(), manifest.gaps.end());
  return open_training_recordings(manifest.recordings, manifest.directory, manifest.crop,
                                  smallest_gap);
}

/// Learning rate of the network that a step with these losses has updated.
double rate_of(const TrainingManifest& manifest, const TrainingPosition& position,
               const StepLosses& losses) {
  const OptimizerSpec& spec = manifest.optimizer;
  const double rate = position.phase != TrainingPhase::kGenerator ? spec.cycle_rate
                      : losses.contains("discriminator")          ? spec.discriminator_rate
                                                                  : spec.generator_rate;
  return learning_rate(rate, spec.final_rate_fraction, position.step,
                       steps_of(manifest.steps, position.phase));
}

bool passed(std::chrono::steady_clock::time_point since, double minutes) {
  return std::chrono::steady_clock::now() - since >= std::chrono::duration<double>(minutes * 60);
}

}  // namespace

TrainingRun::TrainingRun(const TrainingManifest& manifest, const TrainingOptions& options)
    : manifest_(manifest),
      options_(options),
      threads_(use_training_threads(options.threads)),
      source_(manifest, open_all(manifest)),
      trainer_(manifest, options.device),
      folder_{options.output.value_or(manifest.directory / manifest.output_directory)},
      generator_records_(manifest, folder_),
      settings_(training_settings(manifest, source_.recordings())),
      environment_(training_environment(options.device)),
      start_(Clock::now()),
      saved_(start_),
      pictured_(start_),
      lock_(folder_.root) {
  const std::string advice =
      precision_advice(manifest.precision, options.device, instruction_sets());
  if (!advice.empty()) warn(advice);
  for (const TrainingRecording& recording : source_.recordings()) {
    for (const std::string& note : recording.recording->notes()) {
      if (options_.note) options_.note(note);
    }
  }
  if (options.overwrite) folder_.discard();
  folder_.prepare();
  resume();
  losses_.emplace(folder_.losses(), position_);
  generator_records_.go_on_from(position_);
  if (options.make_progress) progress_ = options.make_progress();
}

void TrainingRun::warn(const std::string& text) const {
  if (options_.warn) options_.warn(text);
}

void TrainingRun::resume() {
  const std::optional<TrainingCheckpoint> checkpoint =
      load_checkpoint(folder_.checkpoints(), [&](const std::string& text) { warn(text); });
  if (!checkpoint) return;
  check_resumable(checkpoint->settings, settings_, checkpoint->position, manifest_);
  for (const auto& difference : fingerprint_differences(checkpoint->environment, environment_)) {
    warn("the last bits may differ from those of a training that was never stopped: " + difference);
  }
  try {
    trainer_.load(checkpoint->state);
  } catch (const std::runtime_error&) {
    std::throw_with_nested(
        std::runtime_error("expected the state of this training, got another, in " +
                           last_checkpoint(folder_.checkpoints()).string()));
  }
  position_ = checkpoint->position;
  seconds_before_ = checkpoint->seconds;
}

TrainingReport TrainingRun::run() {
  bool complete = true;
  for (const TrainingPhase phase : kPhases) {
    if (phase < position_.phase) continue;
    if (phase > position_.phase) position_ = {phase, 0};
    complete = train_phase();
    if (steps_unsaved_ > 0) save();
    if (!complete) break;
  }
  progress_.reset();
  TrainingReport report;
  report.folder = folder_.root.string();
  report.complete = complete;
  report.position = position_;
  report.steps_made = steps_made_;
  report.losses = mean_losses(losses_->rows(), position_.phase, kStepsOfMeans);
  if (complete && has_generator()) {
    report.weights = folder_.weights().string();
    report.weights_sha256 = generator_records_.write_final_weights(
        trainer_.generator_state(), position_, source_.recordings(), report.losses);
  }
  report.run_seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  report.total_seconds = total_seconds();
  return report;
}

/// False if it was asked to stop.
bool TrainingRun::train_phase() {
  const std::int64_t end = steps_of(manifest_.steps, position_.phase);
  if (position_.step >= end) return true;
  BatchPrefetch batches(
      [this, phase = position_.phase](std::int64_t step) { return source_.batch(phase, step); },
      position_.step, end, kBatchesAhead);
  while (position_.step < end) {
    if (asked_to_stop()) return false;
    const std::vector<TrainingSample> batch = batches.next();
    const StepLosses losses = take_step(batch);
    losses_->add(position_, total_seconds(), losses, rate_of(manifest_, position_, losses));
    ++position_.step;
    ++steps_made_;
    ++steps_unsaved_;
    if (progress_) progress_->advance(position_.phase, position_.step, end, losses);
    keep_records(batch);
  }
  return true;
}

StepLosses TrainingRun::take_step(const std::vector<TrainingSample>& batch) {
  try {
    return trainer_.step(position_.phase, position_.step, batch);
  } catch (const UnsoundLoss&) {
    const fs::path good = last_checkpoint(folder_.checkpoints());
    std::throw_with_nested(std::runtime_error(
        "the training broke down in phase " + std::string(to_string(position_.phase)) + ", step " +
        std::to_string(position_.step) +
        "; last good checkpoint: " + (good.empty() ? "none" : good.string()) +
        " (a lower learning rate, or other recordings, and --overwrite start again)"));
  }
}

void TrainingRun::keep_records(const std::vector<TrainingSample>& batch) {
  if (has_generator() && passed(pictured_, manifest_.picture_minutes)) {
    generator_records_.draw(trainer_.generator_state(), position_, batch);
    use_training_threads(threads_);
    pictured_ = Clock::now();
  }
  if (passed(saved_, manifest_.checkpoint_minutes)) save();
}

void TrainingRun::save() {
  losses_->flush();
  save_checkpoint(folder_.checkpoints(),
                  {position_, total_seconds(), settings_, environment_, trainer_.state()});
  write_loss_curves(losses_->rows(), folder_.curves());
  if (has_generator()) {
    generator_records_.save(trainer_.generator_state(), position_);
    use_training_threads(threads_);
  }
  steps_unsaved_ = 0;
  saved_ = Clock::now();
}

bool TrainingRun::asked_to_stop() const {
  return (options_.max_steps && steps_made_ >= *options_.max_steps) ||
         (options_.stop && options_.stop());
}

bool TrainingRun::has_generator() const {
  return position_.phase == TrainingPhase::kGenerator && position_.step > 0;
}

double TrainingRun::total_seconds() const {
  return seconds_before_ + std::chrono::duration<double>(Clock::now() - start_).count();
}

TrainingReport run_training(const TrainingManifest& manifest, const TrainingOptions& options) {
  return TrainingRun(manifest, options).run();
}

}  // namespace eventgan
