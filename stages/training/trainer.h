#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>

#include "manifests/values/training.h"
#include "manifests/values/weights.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// Throws UsageError if the networks cannot be trained so: a single crop of up to 16x16, too little
/// for batch norm; a generator phase with no loss, or with the adversarial one and a crop smaller
/// than 48 pixels a side or an odd batch.
void check_trainable(const TrainingManifest& manifest);

/// The rate of step 0..steps-1 of a phase, falling from `rate` to final_fraction · rate by half a
/// cosine: rate · (f + (1 - f) · (1 + cos(π step / steps)) / 2). Steps from `steps` on have the
/// final rate.
double learning_rate(double rate, double final_fraction, std::int64_t step, std::int64_t steps);

/// `value` in a step of a phase that fades it out: it falls on a line to 0 at the step `end`, and
/// stays 0. So the output slope does until half of the generator's steps, and the direct losses of
/// a network that knows its sensor until their end.
double faded(double value, std::int64_t step, double end);

/// Losses of one step by name: "flow.photometric", "flow.smoothness", "flow", "reconstruction",
/// "volume", "count", "overlap", "likelihood", "block_likelihood", "generator" (adversarial),
/// "generator.total", "discriminator", "discriminator.real_accuracy",
/// "discriminator.fake_accuracy"; only those the step computed. Each before its weight, "flow" and
/// "generator.total" being weighted sums.
using StepLosses = std::map<std::string, double>;

/// A loss or a gradient that is not finite. The networks are as before the step.
class UnsoundLoss : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The networks, losses and optimisers of a training, one step at a time. It draws no random number
/// of its own: labels to flip come from (seed, step), so state() is all there is to resume from.
/// Not thread safe; LibTorch's intra-operation threads are the caller's to set, and change the last
/// bits.
class Trainer {
 public:
  /// `device`: "cpu", or "cuda" where LibTorch has it; throws UsageError for others, and as
  /// check_trainable.
  Trainer(const TrainingManifest& manifest, const std::string& device);
  ~Trainer();

  /// One update. `step` counts from 0 in its phase and decides, in the generator phase, whether it
  /// is the discriminator's or the generator's turn; samples: manifest.batch of one shape. Throws
  /// UnsoundLoss, with the samples' origins, before anything is changed; std::invalid_argument if
  /// the samples do not fit; std::runtime_error if LibTorch fails, likewise.
  StepLosses step(TrainingPhase phase, std::int64_t step, std::span<const TrainingSample> samples);

  /// Everything needed to go on: parameters, buffers and optimisers' moments, of the generator and
  /// of those networks that a phase or a loss of the manifest uses.
  StateDict state() const;

  /// Throws std::runtime_error naming what is missing or has another shape; then nothing is defined
  /// but another load().
  void load(const StateDict& state);

  /// The generator's state dict with the published names, as fold_generator takes it.
  StateDict generator_state() const;

 private:
  struct Learners;
  std::unique_ptr<Learners> learners_;
};

}  // namespace eventgan
