#include "manifests/manifest_text_internal.h"
#include "manifests/training_settings_internal.h"
#include "manifests/training_words_internal.h"

namespace eventgan {
namespace {

constexpr std::int64_t kMostFrames = 1'000'000'000;
constexpr std::int64_t kMostSteps = 1'000'000'000;
// Rates and factors beyond these are slips of the pen.
constexpr double kLeastRate = 1e-9;
constexpr double kLargestRate = 1;
constexpr double kLargestFactor = 1e6;

void read_camera(const StrictValue& value, RecordingSpec& spec) {
  if (spec.format != RecordingFormat::kMvsec) {
    value.fault("no such key for format \"" + std::string(to_string(spec.format)) +
                "\" (of mvsec only)");
    return;
  }
  spec.camera = value.text("\"left\" or \"right\"",
                           [](std::string_view text) { return text == "left" || text == "right"; });
}

/// Two numbers, the second not below the first.
std::array<double, 2> read_range(const StrictValue& value, double lowest, double highest) {
  const auto elements = value.elements(2);
  if (elements.empty()) return {1, 1};
  if (elements.size() != 2) {
    value.fault("an array of 2");
    return {1, 1};
  }
  const std::array range{elements[0].number(lowest, highest), elements[1].number(lowest, highest)};
  if (range[1] < range[0]) elements[1].fault("a number not below the one before it");
  return range;
}

std::array<double, 2> read_betas(const StrictValue& value) {
  constexpr double kLargestBeta = 0.999999;
  const auto elements = value.elements(2);
  if (elements.empty()) return {};
  if (elements.size() != 2) value.fault("an array of 2");
  return {elements[0].number(0, kLargestBeta), elements[1].number(0, kLargestBeta)};
}

}  // namespace

RecordingSpec read_recording(const StrictValue& value) {
  RecordingSpec spec;
  StrictObject object = value.object();
  spec.path = read_path(object.at("path"));
  const auto format = object.at("format").sound_choice(kRecordingFormatWords);
  spec.format = format.value_or(spec.format);
  if (const auto camera = object.find("camera")) read_camera(*camera, spec);
  if (const auto weight = object.find("weight")) spec.weight = weight->number(1e-6, 1e6);
  if (const auto first = object.find("first_frame")) {
    spec.first_frame = first->integer<std::int64_t>(0, kMostFrames);
  }
  if (const auto last = object.find("last_frame")) {
    spec.last_frame = last->sound_integer(1, kMostFrames);
    if (spec.last_frame && *spec.last_frame <= spec.first_frame) {
      last->fault("a frame after first_frame (" + std::to_string(spec.first_frame) + ")");
    }
  }
  object.finish();
  return spec;
}

NetworkSpec read_network(const StrictValue& value) {
  NetworkSpec spec;
  StrictObject object = value.object();
  if (const auto channels = object.find("generator_channels")) {
    spec.generator_channels = channels->integer(1, 64);
  }
  if (const auto channels = object.find("discriminator_channels")) {
    spec.discriminator_channels = channels->integer(1, 128);
  }
  if (const auto channels = object.find("cycle_channels")) {
    spec.cycle_channels = channels->integer(1, 64);
  }
  if (const auto place = object.find("spectral_norm")) {
    spec.spectral_norm = place->choice(kSpectralNormWords);
  }
  if (const auto bins = object.find("bins")) spec.bins = bins->integer(1, 64);
  object.finish();
  return spec;
}

LossWeights read_losses(const StrictValue& value) {
  LossWeights losses;
  StrictObject object = value.object();
  const auto read = [&](const char* key, double& factor) {
    if (const auto found = object.find(key)) factor = found->number(0, kLargestFactor);
  };
  read("adversarial", losses.adversarial);
  read("flow", losses.flow);
  read("reconstruction", losses.reconstruction);
  read("volume", losses.volume);
  read("count", losses.count);
  if (const auto quantile = object.find("quantile")) losses.quantile = quantile->number(0.01, 0.99);
  read("smoothness", losses.smoothness);
  object.finish();
  return losses;
}

AugmentationSpec read_augmentation(const StrictValue& value) {
  AugmentationSpec spec;
  StrictObject object = value.object();
  if (const auto flip = object.find("flip")) spec.flip = flip->boolean();
  if (const auto gain = object.find("gain")) spec.gain = read_range(*gain, 0.1, 10);
  if (const auto gamma = object.find("gamma")) spec.gamma = read_range(*gamma, 0.1, 10);
  if (const auto fraction = object.find("static_fraction")) {
    spec.static_fraction = fraction->number(0, 1);
  }
  object.finish();
  return spec;
}

OptimizerSpec read_optimizer(const StrictValue& value) {
  OptimizerSpec spec;
  StrictObject object = value.object();
  const auto read_rate = [&](const char* key, double& rate) {
    if (const auto found = object.find(key)) rate = found->number(kLeastRate, kLargestRate);
  };
  read_rate("generator_rate", spec.generator_rate);
  read_rate("cycle_rate", spec.cycle_rate);
  read_rate("discriminator_rate", spec.discriminator_rate);
  if (const auto betas = object.find("betas")) spec.betas = read_betas(*betas);
  if (const auto fraction = object.find("final_rate_fraction")) {
    spec.final_rate_fraction = fraction->number(0, 1);
  }
  object.finish();
  return spec;
}

PhaseSteps read_steps(const StrictValue& value) {
  PhaseSteps steps;
  StrictObject object = value.object();
  const auto read = [&](const char* key, std::int64_t& count) {
    if (const auto found = object.find(key)) count = found->integer<std::int64_t>(0, kMostSteps);
  };
  read("flow", steps.flow);
  read("reconstruction", steps.reconstruction);
  read("generator", steps.generator);
  object.finish();
  return steps;
}

}  // namespace eventgan
