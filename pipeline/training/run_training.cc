#include "pipeline/training/run_training.h"

#include <ATen/Parallel.h>
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/files/atomic_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/words.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/training/generator_records.h"
#include "pipeline/training/loss_log.h"
#include "pipeline/training/sample_source.h"
#include "pipeline/training/training_checkpoint.h"
#include "pipeline/training/training_folder.h"
#include "stages/base/processor/processor.h"
#include "stages/training/trainer.h"

namespace eventgan {

std::string precision_advice(TrainingPrecision precision, const std::string& device,
                             const std::string& instructions) {
  // Every processor with AMX for bfloat16 has these too.
  const bool fast = device != "cpu" || instructions.find("avx512bf16") != std::string::npos;
  if (precision == TrainingPrecision::kFloat32 || fast) return "";
  return "precision bfloat16 is slower than float32 on this processor, which has no instructions "
         "for it (" +
         instructions + ")";
}

namespace {

/// Sets how many threads LibTorch's operations use when the calling thread runs them; 0: as many as
/// the machine has cores. The last bits of a training depend on the number. Gives the number.
int use_training_threads(int requested) {
  const int threads = thread_count(requested);
  at::set_num_threads(threads);
  omp_set_num_threads(threads);  // oneDNN reads OpenMP's
  return threads;
}

/// One run of a training: goes on from the folder's checkpoint, takes steps, keeps the records. For
/// one thread, the one that made it.
class TrainingRun {
 public:
  /// Opens everything, and loads the checkpoint if there is one. Throws as run_training.
  TrainingRun(const TrainingManifest& manifest, const TrainingOptions& options);

  /// To the end, or until it is asked to stop.
  TrainingReport run();

 private:
  using Clock = std::chrono::steady_clock;

  bool train_phase();
  StepLosses take_step(const std::vector<TrainingSample>& batch);
  void keep_records(const std::vector<TrainingSample>& batch);
  void save();
  void discard();
  void resume();
  void warn(const std::string& text) const;
  bool asked_to_stop() const;
  bool has_generator() const;
  double total_seconds() const;

  const TrainingManifest& manifest_;
  const TrainingOptions& options_;
  int threads_;
  SampleSource source_;
  Trainer trainer_;
  TrainingFolder folder_;
  GeneratorRecords generator_records_;
  std::map<std::string, std::string> settings_;
  std::map<std::string, std::string> environment_;
  TrainingPosition position_;
  Clock::time_point start_;
  Clock::time_point saved_;
  Clock::time_point shown_;
  TrainingLock lock_;
  double seconds_before_ = 0;
  std::int64_t steps_made_ = 0;
  std::int64_t steps_unsaved_ = 0;
  std::optional<LossLog> losses_;
  std::unique_ptr<TrainingProgress> progress_;
};

namespace fs = std::filesystem;

constexpr int kBatchesAhead = 2;
constexpr std::size_t kStepsOfMeans = 100;

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

TrainingFolder folder_of(const TrainingManifest& manifest, const TrainingOptions& options) {
  return {options.output.value_or(manifest.directory / manifest.output_directory)};
}

}  // namespace

TrainingRun::TrainingRun(const TrainingManifest& manifest, const TrainingOptions& options)
    : manifest_(manifest),
      options_(options),
      threads_(use_training_threads(options.threads)),
      source_(manifest, open_all(manifest)),
      trainer_(manifest, options.device),
      folder_(folder_of(manifest, options)),
      generator_records_(manifest, folder_),
      settings_(training_settings(manifest, source_.recordings())),
      environment_(training_environment(options.device)),
      start_(Clock::now()),
      saved_(start_),
      shown_(start_),
      lock_(folder_.root) {
  const std::string advice =
      precision_advice(manifest.precision, options.device, instruction_sets());
  if (!advice.empty()) warn(advice);
  for (const TrainingRecording& recording : source_.recordings()) {
    for (const std::string& note : recording.recording->notes()) {
      if (options_.note) options_.note(note);
    }
  }
  if (options.overwrite) discard();
  folder_.prepare();
  resume();
  losses_.emplace(folder_.losses(), position_);
  generator_records_.go_on_from(position_);
  if (options.make_progress) progress_ = options.make_progress();
}

void TrainingRun::warn(const std::string& text) const {
  if (options_.warn) options_.warn(text);
}

/// Also where the checkpoints are damaged and tell nobody whose they are.
void TrainingRun::discard() {
  std::optional<TrainingCheckpoint> checkpoint;
  try {
    checkpoint = load_checkpoint(folder_.checkpoints(), [](const std::string&) {});
  } catch (const std::runtime_error&) {
  }
  if (checkpoint) check_same_training(checkpoint->settings, settings_);
  folder_.discard();
}

void TrainingRun::resume() {
  const std::optional<TrainingCheckpoint> checkpoint =
      load_checkpoint(folder_.checkpoints(), [&](const std::string& text) { warn(text); });
  if (!checkpoint) {  // a stop before the first one could not be told from another's results
    save_checkpoint(folder_.checkpoints(),
                    {position_, 0, settings_, environment_, trainer_.state()});
    return;
  }
  check_resumable(checkpoint->settings, settings_, checkpoint->position, manifest_);
  for (const auto& difference : fingerprint_differences(checkpoint->environment, environment_)) {
    warn("the last bits may differ from those of an uninterrupted training: " + difference);
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
  for (const auto& [word, phase] : kPhaseWords) {
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
        trainer_.generator_state(), position_, settings_, report.losses);
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
    std::throw_with_nested(std::runtime_error(
        "training diverged in phase " + std::string(to_string(position_.phase)) + ", step " +
        std::to_string(position_.step) +
        "; last good checkpoint: " + last_checkpoint(folder_.checkpoints()).string() +
        " (try a lower learning rate with --overwrite, or other recordings in another folder)"));
  }
}

void TrainingRun::keep_records(const std::vector<TrainingSample>& batch) {
  const bool is_last = position_.step == steps_of(manifest_.steps, position_.phase);
  if (has_generator() && (is_last || passed(shown_, manifest_.image_minutes))) {
    generator_records_.draw(trainer_.generator_state(), position_, batch);
    use_training_threads(threads_);
    shown_ = Clock::now();
  }
  if (passed(saved_, manifest_.checkpoint_minutes)) save();
}

/// The tables come first: rows beyond the checkpoint are cut off when the training resumes, and a
/// kill in between must not leave one out.
void TrainingRun::save() {
  losses_->flush();
  if (has_generator()) {
    generator_records_.save(trainer_.generator_state(), position_);
    use_training_threads(threads_);
  }
  save_checkpoint(folder_.checkpoints(),
                  {position_, total_seconds(), settings_, environment_, trainer_.state()});
  write_file_atomically(folder_.curves(), loss_curves(losses_->rows()));
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
  folder_of(manifest, options).require_own(options.overwrite);
  return TrainingRun(manifest, options).run();
}

}  // namespace eventgan
