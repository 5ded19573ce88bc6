#pragma once

#include <ATen/core/Tensor.h>
#include <c10/core/Device.h>

#include <string>
#include <vector>

#include "manifests/values/training.h"
#include "manifests/values/weights.h"
#include "stages/training/networks/detail/patch_discriminator.h"
#include "stages/training/networks/detail/unet.h"

namespace eventgan {

/// "cpu", or "cuda" where LibTorch was built with CUDA and finds a device; throws UsageError else.
c10::Device training_device(const std::string& name);

/// The four networks of a training, and in which precision they run.
struct TrainingNetworks {
  /// Starting values from the manifest's seed, each network's its own.
  TrainingNetworks(const TrainingManifest& manifest, c10::Device device);

  /// The network's outputs in float32, whatever precision it runs in.
  std::vector<at::Tensor> run(UNet& network, const at::Tensor& input) const;
  at::Tensor discriminate(const at::Tensor& volume, const at::Tensor& images);

  /// The generator alone, its first layer of the frames whatever it was trained in.
  StateDict generator_of_frames() const;

  UNet generator{nullptr};       ///< two frames → volume
  UNet flow{nullptr};            ///< volume → flow at four scales
  UNet reconstruction{nullptr};  ///< [sum of the volume, previous frame] → next at four scales
  PatchDiscriminator discriminator{nullptr};
  c10::Device device;
  bool bfloat16;
  double difference_gain;  ///< of the generator
};

}  // namespace eventgan
