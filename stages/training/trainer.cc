#include "stages/training/trainer.h"

#include <ATen/Functions.h>
#include <fmt/format.h>
#include <torch/nn/module.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "manifests/values/training.h"
#include "stages/training/detail/training_batch.h"
#include "stages/training/detail/training_networks.h"
#include "stages/training/detail/update_loss.h"
#include "stages/training/networks/detail/network_state.h"
#include "stages/training/networks/detail/patch_discriminator.h"
#include "stages/training/radam.h"

namespace eventgan {
namespace {

/// Batch norm divides by a spread, which a single value does not have: the deepest layers see one
/// pixel of a 16x16 crop.
void check_batch(const TrainingManifest& manifest) {
  const auto deepest = [](int side) { return (side + 15) / 16; };
  if (manifest.batch > 1 || deepest(manifest.crop.height) * deepest(manifest.crop.width) > 1)
    return;
  throw UsageError("expected a batch of at least 2 for a crop of " + to_string(manifest.crop) +
                   ", got 1, in " + manifest.name);
}

/// The manifest's reader refuses these too; a manifest may also be made in code.
void check_generator_phase(const TrainingManifest& manifest) {
  const LossWeights& weights = manifest.losses;
  if (manifest.steps.generator == 0) return;
  if (std::ranges::none_of(kLossTerms,
                           [&](const LossTerm& term) { return weights.*term.weight != 0; })) {
    throw UsageError("expected a loss for the generator, got weight 0 for all, in " +
                     manifest.name);
  }
  if (weights.adversarial == 0) return;
  constexpr int kSmallest = PatchDiscriminatorImpl::smallest_side();
  if (manifest.crop.height < kSmallest || manifest.crop.width < kSmallest) {
    throw UsageError("expected a crop of at least " + std::to_string(kSmallest) +
                     " pixels a side for the adversarial loss, got " + to_string(manifest.crop) +
                     ", in " + manifest.name);
  }
  if (manifest.batch % 2 != 0) {
    throw UsageError("expected an even batch for the adversarial loss, got " +
                     std::to_string(manifest.batch) + ", in " + manifest.name);
  }
}

}  // namespace

void check_trainable(const TrainingManifest& manifest) {
  check_batch(manifest);
  check_generator_phase(manifest);
}

double learning_rate(double rate, double final_fraction, std::int64_t step, std::int64_t steps) {
  const double progress = step < steps ? double(step) / double(steps) : 1;
  const double fall = (1 + std::cos(std::numbers::pi * progress)) / 2;
  return rate * (final_fraction + (1 - final_fraction) * fall);
}

double faded(double value, std::int64_t step, double end) {
  return end > 0 ? value * std::max(0.0, 1 - double(step) / end) : 0;
}

/// A network and what changes it.
struct Learner {
  Learner(const std::string& network_name, torch::nn::Module& module, double base_rate,
          const OptimizerSpec& spec);

  void save(StateDict& state) const;
  void load(const StateDict& state);

  std::string name;
  torch::nn::Module* network;
  double rate;  ///< at the start of its phase
  RAdam optimizer;
};

Learner::Learner(const std::string& network_name, torch::nn::Module& module, double base_rate,
                 const OptimizerSpec& spec)
    : name(network_name),
      network(&module),
      rate(base_rate),
      optimizer(module.parameters(), {base_rate, spec.betas[0], spec.betas[1]}) {}

void Learner::save(StateDict& state) const {
  save_network(*network, state, name + ".");
  optimizer.save(state, "optimizer." + name);
}

void Learner::load(const StateDict& state) {
  load_network(*network, state, name + ".");
  optimizer.load(state, "optimizer." + name);
}

namespace {

/// Batch norm's mode, and whether gradients are computed.
void set_learning(torch::nn::Module& network, bool learning) {
  network.train(learning);
  for (at::Tensor& parameter : network.parameters()) parameter.set_requires_grad(learning);
}

/// Of all parameters that have a gradient. One beyond 1.8e19 counts as not finite: its square is
/// not, and would stay in the optimiser's second moments for ever.
bool gradients_are_finite(const torch::nn::Module& network) {
  // A sum is not finite if a term is not, and costs one pass.
  std::vector<at::Tensor> sums;
  for (const at::Tensor& parameter : network.parameters()) {
    if (!parameter.grad().defined()) continue;
    const at::Tensor gradient = parameter.grad().flatten();
    sums.push_back(at::dot(gradient, gradient));
  }
  return sums.empty() || at::isfinite(at::stack(sums)).all().item<bool>();
}

/// The losses' values; throws UnsoundLoss with those that are not finite.
StepLosses values(const UpdateLoss& loss, const std::string& where) {
  StepLosses result;
  std::vector<std::string> faults;
  for (const auto& [name, tensor] : loss.parts) {
    const double value = tensor.item<double>();
    result[name] = value;
    if (std::isfinite(value)) continue;
    faults.push_back(fmt::format("{} {}", name, value));
  }
  if (!faults.empty()) {
    throw UnsoundLoss(
        fmt::format("expected finite losses, got {}{}", fmt::join(faults, ", "), where));
  }
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

  /// Those that a phase or a loss of the manifest uses, the generator first. The others stay as the
  /// seed makes them.
  std::vector<Learner*> used() {
    std::vector<Learner*> found{&generator};
    const auto add = [&](Learner& learner, double weight, std::int64_t steps) {
      if (weight != 0 || steps > 0) found.push_back(&learner);
    };
    add(discriminator, manifest.losses.adversarial, 0);
    add(flow, manifest.losses.flow, manifest.steps.flow);
    add(reconstruction, manifest.losses.reconstruction, manifest.steps.reconstruction);
    return found;
  }

  /// Whose update this step is.
  Learner& turn(TrainingPhase phase, std::int64_t step) {
    if (phase == TrainingPhase::kFlow) return flow;
    if (phase == TrainingPhase::kReconstruction) return reconstruction;
    const bool discriminates =
        manifest.losses.adversarial != 0 &&
        step % (manifest.discriminator_steps + 1) < manifest.discriminator_steps;
    return discriminates ? discriminator : generator;
  }

  UpdateLoss loss(const Learner& learner, const TrainingBatch& batch, std::int64_t step) {
    if (&learner == &flow) return flow_update(networks, batch, manifest.losses);
    if (&learner == &reconstruction) return reconstruction_update(networks, batch);
    if (&learner == &discriminator) return discriminator_update(networks, batch, manifest, step);
    return generator_update(networks, batch, generator_losses(step));
  }

  LossWeights generator_losses(std::int64_t step) const {
    LossWeights weights = manifest.losses;
    if (!manifest.network.sensor) return weights;
    // Until the end, where the learning rate is low: before, the likelihood alone unlearns what
    // they have taught.
    for (const LossTerm& term : kLossTerms) {
      if (term.kind != LossKind::kDirect) continue;
      double& weight = weights.*term.weight;
      weight = faded(weight, step, double(manifest.steps.generator));
    }
    return weights;
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
  networks.generator->set_output_slope(
      faded(manifest.network.output_slope, step, 0.5 * double(manifest.steps.generator)));

  const std::string where = fmt::format(", in {} step {} of {}", to_string(phase), step,
                                        joined(samples, "; ", &TrainingSample::origin));
  const UpdateLoss update_loss = loss(learner, batch, step);
  StepLosses result = values(update_loss, where);
  update_loss.total.backward();
  if (!gradients_are_finite(*learner.network)) {
    throw UnsoundLoss("expected gradients with finite squares, got others" + where);
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
  for (const Learner* each : learners_->used()) each->save(state);
  return state;
}

void Trainer::load(const StateDict& state) {
  for (Learner* each : learners_->used()) each->load(state);
}

StateDict Trainer::generator_state() const { return learners_->networks.generator_of_frames(); }

}  // namespace eventgan
