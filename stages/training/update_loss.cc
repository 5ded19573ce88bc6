#include "stages/training/detail/update_loss.h"

#include <ATen/Functions.h>
#include <ATen/core/grad_mode.h>

#include <algorithm>
#include <array>
#include <ranges>
#include <string>

#include "manifests/values/counter_random.h"
#include "stages/training/losses.h"

namespace eventgan {
namespace {

/// The flow network's loss on a volume, real or generated; `flow` is the sum of its parts.
at::Tensor add_flow_loss(TrainingNetworks& networks, const TrainingBatch& batch,
                         const at::Tensor& volume, double smoothness, UpdateLoss& loss) {
  const FlowLoss flow = multi_scale_flow_loss(
      batch.previous(), batch.next(), networks.run(networks.flow, volume), batch.has_events());
  loss.parts["flow.photometric"] = flow.photometric;
  loss.parts["flow.smoothness"] = flow.smoothness;
  return loss.parts["flow"] = flow.photometric + smoothness * flow.smoothness;
}

at::Tensor add_reconstruction_loss(TrainingNetworks& networks, const TrainingBatch& batch,
                                   const at::Tensor& volume, UpdateLoss& loss) {
  const at::Tensor previous = batch.network_frames.narrow(1, 0, 1);
  const auto images =
      networks.run(networks.reconstruction, at::cat({volume.sum(1, true), previous}, 1));
  return loss.parts["reconstruction"] = multi_scale_reconstruction_loss(images, batch.next());
}

/// [B / 2, 1, h, w] bool: where a label is flipped.
at::Tensor flipped_labels(const at::Tensor& logits, const TrainingManifest& manifest,
                          std::int64_t step) {
  const CounterRandom random =
      CounterRandom(manifest.seed).keyed("labels").keyed(std::to_string(step));
  at::Tensor flipped = at::empty(logits.sizes(), at::kBool);
  bool* values = flipped.data_ptr<bool>();
  for (std::int64_t i = 0; i < flipped.numel(); ++i) {
    values[i] = random.uniform(i) < manifest.label_flip;
  }
  return flipped.to(logits.device());
}

/// The functions of the losses that compare volumes, in the order of kLossTerms.
struct VolumeLoss {
  double LossWeights::*weight;
  at::Tensor (*of)(const at::Tensor& volume, const TrainingBatch& batch,
                   const LossWeights& weights);
};
constexpr std::array kVolumeLosses{
    VolumeLoss{
        &LossWeights::volume,
        [](const at::Tensor& volume, const TrainingBatch& batch, const LossWeights& weights) {
          return volume_loss(volume, batch.volume, weights.quantile);
        }},
    VolumeLoss{
        &LossWeights::count,
        [](const at::Tensor& volume, const TrainingBatch& batch, const LossWeights& weights) {
          return count_loss(volume, batch.volume, weights.quantile);
        }},
    VolumeLoss{&LossWeights::overlap,
               [](const at::Tensor& volume, const TrainingBatch& batch, const LossWeights&) {
                 return overlap_loss(volume, batch.volume);
               }},
    VolumeLoss{&LossWeights::likelihood,
               [](const at::Tensor& volume, const TrainingBatch& batch, const LossWeights&) {
                 return likelihood_loss(volume, batch.expected);
               }},
    VolumeLoss{&LossWeights::block_likelihood,
               [](const at::Tensor& volume, const TrainingBatch& batch, const LossWeights&) {
                 return block_likelihood_loss(volume, batch.expected);
               }}};
static_assert(std::ranges::equal(kVolumeLosses,
                                 kLossTerms | std::views::drop_while([](const LossTerm& term) {
                                   return term.kind == LossKind::kPaper;
                                 }),
                                 {}, &VolumeLoss::weight, &LossTerm::weight),
              "each loss of kLossTerms behind the paper's has its function here");

}  // namespace

UpdateLoss flow_update(TrainingNetworks& networks, const TrainingBatch& batch,
                       const LossWeights& weights) {
  UpdateLoss loss;
  loss.total = add_flow_loss(networks, batch, batch.volume, weights.smoothness, loss);
  return loss;
}

UpdateLoss reconstruction_update(TrainingNetworks& networks, const TrainingBatch& batch) {
  UpdateLoss loss;
  loss.total = add_reconstruction_loss(networks, batch, batch.volume, loss);
  return loss;
}

UpdateLoss discriminator_update(TrainingNetworks& networks, const TrainingBatch& batch,
                                const TrainingManifest& manifest, std::int64_t step) {
  const std::int64_t half = batch.volume.size(0) / 2;
  at::Tensor volumes;
  {
    const at::NoGradGuard generator_stays;
    volumes =
        at::cat({networks.run(networks.generator, batch.generator_input.narrow(0, 0, half))[0],
                 batch.volume.narrow(0, half, half)},
                0);
  }
  // One pass for both halves: the discriminator treats each sample on its own.
  const at::Tensor logits = networks.discriminate(volumes, batch.frames);
  const at::Tensor fake = logits.narrow(0, 0, half);
  const at::Tensor real = logits.narrow(0, half, half);
  const at::Tensor flipped = flipped_labels(real, manifest, step);
  UpdateLoss loss;
  loss.total =
      discriminator_hinge_loss(at::where(flipped, fake, real), at::where(flipped, real, fake));
  loss.parts["discriminator"] = loss.total;
  loss.parts["discriminator.fake_accuracy"] = fake.lt(0).to(at::kFloat).mean();
  loss.parts["discriminator.real_accuracy"] = real.gt(0).to(at::kFloat).mean();
  return loss;
}

UpdateLoss generator_update(TrainingNetworks& networks, const TrainingBatch& batch,
                            const LossWeights& weights) {
  const at::Tensor volume = networks.run(networks.generator, batch.generator_input)[0];
  UpdateLoss loss;
  loss.total = at::zeros({}, volume.options());
  if (weights.adversarial != 0) {
    const at::Tensor logits = networks.discriminate(volume, batch.network_frames);
    loss.parts["generator"] = generator_hinge_loss(logits);
    loss.total = loss.total + weights.adversarial * loss.parts["generator"];
  }
  if (weights.flow != 0) {
    const at::Tensor flow = add_flow_loss(networks, batch, volume, weights.smoothness, loss);
    loss.total = loss.total + weights.flow * flow;
  }
  if (weights.reconstruction != 0) {
    loss.total = loss.total +
                 weights.reconstruction * add_reconstruction_loss(networks, batch, volume, loss);
  }
  for (const VolumeLoss& each : kVolumeLosses) {
    if (weights.*each.weight == 0) continue;
    const auto term = std::ranges::find(kLossTerms, each.weight, &LossTerm::weight);
    const at::Tensor part = each.of(volume, batch, weights);
    loss.parts[std::string(term->word)] = part;
    loss.total = loss.total + weights.*each.weight * part;
  }
  loss.parts["generator.total"] = loss.total;
  return loss;
}

}  // namespace eventgan
