#include "stages/training/trainer.h"

#include <ATen/Functions.h>
#include <ATen/core/grad_mode.h>

#include <cmath>

#include "stages/training/buffer_snapshot_internal.h"
#include "stages/training/check_trainable.h"
#include "stages/training/learner_internal.h"
#include "stages/training/learning_rate.h"
#include "stages/training/networks/network_state_internal.h"
#include "stages/training/training_batch_internal.h"
#include "stages/training/training_device_internal.h"
#include "stages/training/training_networks_internal.h"
#include "stages/training/update_loss_internal.h"

namespace eventgan {
namespace {

std::string origins(std::span<const TrainingSample> samples) {
  std::string text;
  for (const TrainingSample& sample : samples) text += (text.empty() ? "" : "; ") + sample.origin;
  return text;
}

/// The losses' values; throws UnsoundLoss with those that are not finite.
StepLosses values(const UpdateLoss& loss, const std::string& where) {
  StepLosses result;
  std::string faults;
  for (const auto& [name, tensor] : loss.parts) {
    const double value = tensor.item<double>();
    result[name] = value;
    if (std::isfinite(value)) continue;
    faults += (faults.empty() ? "" : ", ") + name + " " + std::to_string(value);
  }
  if (!faults.empty()) throw UnsoundLoss("expected finite losses, got " + faults + where);
  return result;
}

}  // namespace

struct Trainer::Learners {
  Learners(const TrainingManifest& job, const std::string& device)
      : manifest(job),
        networks(job, training_device(device)),
        generator("generator", *networks.generator, job.optimizer.generator_rate, job.optimizer),
        discriminator("discriminator", *networks.discriminator, job.optimizer.discriminator_rate,
                      job.optimizer),
        flow("flow", *networks.flow, job.optimizer.cycle_rate, job.optimizer),
        reconstruction("reconstruction", *networks.reconstruction, job.optimizer.cycle_rate,
                       job.optimizer) {}

  /// Whose update this step is.
  Learner& turn(TrainingPhase phase, std::int64_t step) {
    if (phase == TrainingPhase::kFlow) return flow;
    if (phase == TrainingPhase::kReconstruction) return reconstruction;
    const bool judge = manifest.losses.adversarial != 0 &&
                       step % (manifest.discriminator_steps + 1) < manifest.discriminator_steps;
    return judge ? discriminator : generator;
  }

  UpdateLoss loss(const Learner& learner, const TrainingBatch& batch, std::int64_t step) {
    if (&learner == &flow) return flow_update(networks, batch, manifest.losses);
    if (&learner == &reconstruction) return reconstruction_update(networks, batch);
    if (&learner == &discriminator) return discriminator_update(networks, batch, manifest, step);
    return generator_update(networks, batch, manifest.losses);
  }

  double rate(const Learner& learner, TrainingPhase phase, std::int64_t step) const {
    const std::int64_t steps = phase == TrainingPhase::kFlow ? manifest.steps.flow
                               : phase == TrainingPhase::kReconstruction
                                   ? manifest.steps.reconstruction
                                   : manifest.steps.generator;
    return learning_rate(learner.rate, manifest.optimizer.final_rate_fraction, step, steps);
  }

  StepLosses update(TrainingPhase phase, std::int64_t step,
                    std::span<const TrainingSample> samples);

  TrainingManifest manifest;
  TrainingNetworks networks;
  Learner generator;
  Learner discriminator;
  Learner flow;
  Learner reconstruction;
};

StepLosses Trainer::Learners::update(TrainingPhase phase, std::int64_t step,
                                     std::span<const TrainingSample> samples) {
  const TrainingBatch batch = make_training_batch(samples, manifest.network.bins, networks.device);
  Learner& learner = turn(phase, step);
  for (const Learner* each : {&generator, &discriminator, &flow, &reconstruction}) {
    set_learning(*each->network, each == &learner);
  }
  // The published code has the generator's batch norm learn from the fakes it makes, too.
  if (&learner == &discriminator) generator.network->train();
  BufferSnapshot before({generator.network, learner.network});
  learner.optimizer.zero_grad();

  const std::string where = ", in " + std::string(to_string(phase)) + " step " +
                            std::to_string(step) + " of " + origins(samples);
  const UpdateLoss update_loss = loss(learner, batch, step);
  StepLosses result = values(update_loss, where);
  update_loss.total.backward();
  if (!gradients_are_finite(*learner.network)) {
    throw UnsoundLoss("expected finite gradients, got others" + where);
  }
  learner.optimizer.set_rate(rate(learner, phase, step));
  learner.optimizer.step();
  before.keep_current();
  return result;
}

Trainer::Trainer(const TrainingManifest& manifest, const std::string& device) {
  check_trainable(manifest);
  learners_ = std::make_unique<Learners>(manifest, device);
}

Trainer::~Trainer() = default;

StepLosses Trainer::step(TrainingPhase phase, std::int64_t step,
                         std::span<const TrainingSample> samples) {
  try {
    return learners_->update(phase, step, samples);
  } catch (const c10::Error&) {
    std::throw_with_nested(std::runtime_error("the training step failed in LibTorch"));
  }
}

StateDict Trainer::state() const {
  StateDict state;
  const Learners& all = *learners_;
  all.networks.save(state);
  for (const Learner* each : {&all.generator, &all.discriminator, &all.flow, &all.reconstruction}) {
    each->optimizer.save(state, each->state_prefix);
  }
  return state;
}

void Trainer::load(const StateDict& state) {
  Learners& all = *learners_;
  all.networks.load(state);
  for (Learner* each : {&all.generator, &all.discriminator, &all.flow, &all.reconstruction}) {
    each->optimizer.load(state, each->state_prefix);
  }
}

StateDict Trainer::generator_state() const {
  StateDict state;
  save_network(*learners_->networks.generator, state, "");
  return state;
}

std::vector<float> Trainer::generate(const TrainingSample& sample) const {
  try {
    const at::NoGradGuard only_looking;
    UNet& generator = learners_->networks.generator;
    // Spectral norm moves its vectors even in evaluation; they are put back.
    const BufferSnapshot before({generator.get()});
    generator->eval();
    const at::Tensor volume =
        generator->forward(network_frames_tensor(sample, learners_->networks.device))[0]
            .cpu()
            .contiguous();
    const float* begin = volume.data_ptr<float>();
    return {begin, begin + volume.numel()};
  } catch (const c10::Error&) {
    std::throw_with_nested(std::runtime_error("the generator failed in LibTorch"));
  }
}

}  // namespace eventgan
