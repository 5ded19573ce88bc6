#include "manifests/counter_random.h"
#include "stages/training/autocast_scope_internal.h"
#include "stages/training/networks/initialization_internal.h"
#include "stages/training/networks/network_state_internal.h"
#include "stages/training/training_networks_internal.h"

namespace eventgan {
namespace {

UNetSettings cycle_network(const NetworkSpec& spec, int in_channels, int out_channels) {
  return {in_channels, out_channels, spec.cycle_channels, true, SpectralNormPlace::kNone};
}

}  // namespace

TrainingNetworks::TrainingNetworks(const TrainingManifest& manifest, c10::Device target)
    : device(target), bfloat16(manifest.precision == TrainingPrecision::kBfloat16) {
  const NetworkSpec& spec = manifest.network;
  const int channels = 2 * spec.bins;
  generator = UNet(UNetSettings{2, channels, spec.generator_channels, false, spec.spectral_norm});
  flow = UNet(cycle_network(spec, channels, 2));
  reconstruction = UNet(cycle_network(spec, 2, 1));
  discriminator = PatchDiscriminator(channels, 2, spec.discriminator_channels);

  const auto seed = [&](const char* network) {
    return CounterRandom(manifest.seed).keyed(network).bits(0);
  };
  initialize(*generator, seed("generator"));
  initialize(*flow, seed("flow"));
  initialize(*reconstruction, seed("reconstruction"));
  initialize(*discriminator, seed("discriminator"));
  generator->to(device);
  flow->to(device);
  reconstruction->to(device);
  discriminator->to(device);
}

std::vector<at::Tensor> TrainingNetworks::run(UNet& network, const at::Tensor& input) const {
  std::vector<at::Tensor> outputs;
  {
    const AutocastScope lower(device, bfloat16);
    outputs = network->forward(input);
  }
  for (at::Tensor& output : outputs) output = output.to(at::kFloat);
  return outputs;
}

at::Tensor TrainingNetworks::judge(const at::Tensor& volume, const at::Tensor& images) {
  const AutocastScope lower(device, bfloat16);
  return discriminator->forward(volume, images).to(at::kFloat);
}

void TrainingNetworks::save(StateDict& state) const {
  save_network(*generator, state, "generator.");
  save_network(*discriminator, state, "discriminator.");
  save_network(*flow, state, "flow.");
  save_network(*reconstruction, state, "reconstruction.");
}

void TrainingNetworks::load(const StateDict& state) {
  load_network(*generator, state, "generator.");
  load_network(*discriminator, state, "discriminator.");
  load_network(*flow, state, "flow.");
  load_network(*reconstruction, state, "reconstruction.");
}

}  // namespace eventgan
