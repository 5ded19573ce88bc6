#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "pipeline/training/records/generator_records.h"
#include "pipeline/training/records/loss_log.h"
#include "pipeline/training/records/training_checkpoint.h"
#include "pipeline/training/run_training.h"
#include "pipeline/training/samples/sample_source.h"
#include "pipeline/training/training_folder.h"
#include "pipeline/training/training_lock.h"
#include "stages/training/trainer.h"

namespace eventgan {

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
  Clock::time_point pictured_;
  TrainingLock lock_;
  double seconds_before_ = 0;
  std::int64_t steps_made_ = 0;
  std::int64_t steps_unsaved_ = 0;
  std::optional<LossLog> losses_;
  std::unique_ptr<TrainingProgress> progress_;
};

}  // namespace eventgan
