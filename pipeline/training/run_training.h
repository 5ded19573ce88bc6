#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "manifests/values/training.h"
#include "pipeline/training/report/training_report.h"

namespace eventgan {

/// A warning that bfloat16 is slower than float32 where the processor has no instructions for it;
/// empty where nothing speaks against the precision. `instructions`: as instruction_sets() gives.
std::string precision_advice(TrainingPrecision precision, const std::string& device,
                             const std::string& instructions);

struct TrainingOptions {
  std::optional<std::filesystem::path> output;  ///< instead of the manifest's
  int threads = 0;                              ///< of LibTorch; 0: all cores
  std::string device = "cpu";                   ///< "cpu" or "cuda"
  bool overwrite = false;                       ///< discard what an earlier run of this one left
  /// Asked before every step; true ends the run with a checkpoint. None: never.
  std::function<bool()> stop;
  std::optional<std::int64_t> max_steps;  ///< stop after so many steps of this run; for tests
  std::function<void(const std::string&)> warn;                      ///< none: silent
  std::function<void(const std::string&)> note;                      ///< none: silent
  std::function<std::unique_ptr<TrainingProgress>()> make_progress;  ///< none: silent
};

/// Trains the phases one after another, or goes on from the output folder's checkpoint, and writes
///
/// - checkpoints/{latest,previous}.safetensors: every checkpoint_minutes, after each phase and at
///   the end of the run; what a later run goes on from;
/// - weights-latest.safetensors: with each checkpoint of the generator phase;
/// - weights.safetensors: at the end;
/// - training.csv, curves.svg: the losses;
/// - validation.csv: realism of the validation pairs, with each checkpoint of the generator phase;
/// - training.lock: see TrainingLock;
/// - images/generator-STEP.png: every image_minutes of the generator phase, and after its last
///   step; frames, generated, real, of four validation pairs, or of the batch where there is no
///   validation.
///
/// The weights are the same however often the training was stopped, with one number of threads, one
/// kind of processor and one set of libraries. Throws UsageError (settings that do not fit the
/// checkpoint, or recordings that do not fit the manifest), InputError, and std::runtime_error: a
/// loss that is not finite (phase, step, samples and last good checkpoint in the message), a folder
/// that another run writes to, or I/O.
TrainingReport run_training(const TrainingManifest& manifest, const TrainingOptions& options);

}  // namespace eventgan
