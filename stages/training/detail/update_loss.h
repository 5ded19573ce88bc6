#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <map>
#include <string>

#include "manifests/values/training.h"
#include "stages/training/detail/training_batch.h"
#include "stages/training/detail/training_networks.h"

namespace eventgan {

/// What one update of one network minimises, and the parts by the names of StepLosses: scalars in
/// float32.
struct UpdateLoss {
  at::Tensor total;
  std::map<std::string, at::Tensor> parts;
};

// The updates of the published trainers (EventGAN, section 3). All losses compare with frames as
// recorded; networks see the frames with gain and gamma. A term whose weight is 0 is not computed.
// Where the published code differs:
// - its reconstruction network learns from the finest of its four scales alone, though the
//   generator is then judged by all four;
// - its generator's reconstruction loss compares with the next frame as changed by gain and gamma,
//   which the reconstruction network was not trained to give;
// - its frozen networks go back to batch norm's training mode after the first validation.

/// Flow network, on the real volume: photometric loss where there are events, and smoothness.
UpdateLoss flow_update(TrainingNetworks& networks, const TrainingBatch& batch,
                       const LossWeights& weights);

/// Reconstruction network, on the real volume.
UpdateLoss reconstruction_update(TrainingNetworks& networks, const TrainingBatch& batch);

/// Discriminator: the first half of the batch with generated volumes, the second with real ones,
/// all with frames as recorded. With probability `label_flip` the real and the generated logit of
/// one place change sides; which ones is a function of seed and step.
UpdateLoss discriminator_update(TrainingNetworks& networks, const TrainingBatch& batch,
                                const TrainingManifest& manifest, std::int64_t step);

/// Generator: what discriminator (which sees the network's frames here), flow network and
/// reconstruction network say to its volume, and its distance from the real one.
UpdateLoss generator_update(TrainingNetworks& networks, const TrainingBatch& batch,
                            const LossWeights& weights);

}  // namespace eventgan
