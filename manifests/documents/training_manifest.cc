#include "manifests/documents/training_manifest.h"

#include <algorithm>

#include "manifests/documents/detail/job_manifest.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/values/words.h"

namespace eventgan {
namespace {

constexpr std::string_view kTrainingFormat = "eventgan-training";
constexpr int kTrainingVersion = 1;

// As for conversion: below 16 pixels the generator's four halvings leave nothing of the image.
constexpr int kSmallestCrop = 16;
constexpr int kLargestCrop = 2048;
// The discriminator halves an image four times and then takes a pixel off twice.
constexpr int kSmallestAdversarialCrop = 48;

constexpr double kMostMinutes = 1e6;
constexpr std::int64_t kMostFrames = 1'000'000'000;
constexpr std::int64_t kMostSteps = 1'000'000'000;
// Rates and factors beyond these are slips of the pen.
constexpr double kLeastRate = 1e-9;
constexpr double kLargestRate = 1;
constexpr double kLargestFactor = 1e6;

/// Recordings that may have frames: the first of all formats.
constexpr std::array kFormatWords{kRecordingFormatWords[0], kRecordingFormatWords[1],
                                  kRecordingFormatWords[2], kRecordingFormatWords[3],
                                  kRecordingFormatWords[4]};
static_assert(kFormatWords.back().value == RecordingFormat::kDsec);

/// Reads the keys that only some formats have.
void read_options(StrictObject& object, RecordingSpec& spec) {
  using enum RecordingFormat;
  SpecialKeys keys(object, "format", std::optional(spec.format));
  if (const auto camera = keys.find("camera", {kMvsec})) {
    spec.options.camera = read_stereo_camera(*camera);
  }
  if (const auto rectify = keys.find("rectify", {kDsec})) spec.options.rectify = rectify->boolean();
}

std::array<double, 2> read_betas(const StrictValue& value) {
  constexpr double kLargestBeta = 0.999999;
  const auto elements = value.elements(2);
  if (elements.empty()) return {};
  if (elements.size() != 2) value.fault("an array of 2");
  return {elements[0].number(0, kLargestBeta), elements[1].number(0, kLargestBeta)};
}

RecordingSpec read_recording(const StrictValue& value) {
  RecordingSpec spec;
  StrictObject object = value.object();
  spec.path = read_path(object.at("path"));
  const auto format = object.at("format").sound_choice(kFormatWords);
  spec.format = format.value_or(spec.format);
  read_options(object, spec);
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
  if (const auto threshold = object.find("threshold")) {
    spec.threshold = ContrastThreshold{threshold->number(0.01, 5)};
  }
  if (const auto ratio = object.find("threshold_ratio")) {
    if (spec.threshold) {
      spec.threshold->ratio = ratio->number(0.2, 5);
    } else {
      ratio->fault("threshold beside it", "none");
    }
  }
  object.finish();
  return spec;
}

SimulatedSpec read_simulated(const StrictValue& value) {
  SimulatedSpec spec;
  StrictObject object = value.object();
  for (const StrictValue& folder : object.at("textures").elements(1)) {
    spec.textures.push_back(read_path(folder));
  }
  if (const auto fraction = object.find("fraction")) spec.fraction = fraction->number(0, 1);
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
  if (const auto slope = object.find("output_slope")) spec.output_slope = slope->number(0, 1);
  if (const auto gain = object.find("difference_gain")) {
    spec.difference_gain = gain->number(0, 1000);
  }
  if (const auto sensor = object.find("sensor")) spec.sensor = sensor->boolean();
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
  read("overlap", losses.overlap);
  read("likelihood", losses.likelihood);
  read("block_likelihood", losses.block_likelihood);
  if (const auto quantile = object.find("quantile")) losses.quantile = quantile->number(0.01, 0.99);
  read("smoothness", losses.smoothness);
  object.finish();
  return losses;
}

AugmentationSpec read_augmentation(const StrictValue& value) {
  AugmentationSpec spec;
  StrictObject object = value.object();
  if (const auto flip = object.find("flip")) spec.flip = flip->boolean();
  if (const auto reverse = object.find("reverse")) spec.reverse = reverse->boolean();
  if (const auto gain = object.find("gain")) spec.gain = read_ends(*gain, 0.1, 10);
  if (const auto gamma = object.find("gamma")) spec.gamma = read_ends(*gamma, 0.1, 10);
  if (const auto fraction = object.find("static_fraction")) {
    spec.static_fraction = fraction->number(0, 1);
  }
  if (const auto fraction = object.find("event_fraction")) {
    spec.event_fraction = fraction->number(0, 1);
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

std::vector<RecordingSpec> read_recordings(const StrictValue& value, std::size_t least) {
  std::vector<RecordingSpec> recordings;
  for (const StrictValue& element : value.elements(least)) {
    recordings.push_back(read_recording(element));
  }
  return recordings;
}

ImageSize read_crop(const StrictValue& value, bool adversarial) {
  StrictObject object = value.object();
  const int smallest = adversarial ? kSmallestAdversarialCrop : kSmallestCrop;
  const ImageSize crop{object.at("height").integer(smallest, kLargestCrop),
                       object.at("width").integer(smallest, kLargestCrop)};
  object.finish();
  return crop;
}

int read_batch(const StrictValue& value, bool adversarial) {
  const auto batch = value.sound_integer(1, 512);
  if (adversarial && batch && *batch % 2 != 0) {
    value.fault("an even batch, since losses.adversarial > 0");
  }
  return static_cast<int>(batch.value_or(2));
}

/// The generator learns through the frozen flow and reconstruction network, so they must have been
/// trained; and from something at all.
void check_phases(const StrictValue& steps, const StrictValue& losses,
                  const TrainingManifest& manifest) {
  const PhaseSteps& count = manifest.steps;
  const LossWeights& factor = manifest.losses;
  if (count.flow == 0 && count.reconstruction == 0 && count.generator == 0) {
    steps.fault("at least one phase with more than 0 steps", "none");
  }
  if (count.generator == 0) return;
  const auto check = [&](std::int64_t phase_steps, double loss, const std::string& name) {
    if (loss > 0 && phase_steps == 0) {
      steps.fault("steps." + name + " > 0 while losses." + name + " > 0", "0 steps");
    }
  };
  check(count.flow, factor.flow, "flow");
  check(count.reconstruction, factor.reconstruction, "reconstruction");
  const bool published = factor.adversarial != 0 || factor.flow != 0 || factor.reconstruction != 0;
  const bool direct = factor.volume != 0 || factor.count != 0 || factor.overlap != 0;
  if (manifest.network.sensor && (published || factor.likelihood == 0)) {
    losses.fault("likelihood above 0 and adversarial, flow, reconstruction 0, since network.sensor",
                 "others");
  } else if (!manifest.network.sensor && (factor.likelihood != 0 || factor.block_likelihood != 0)) {
    losses.fault("likelihood and block_likelihood 0, unless network.sensor", "others");
  } else if (!published && !direct && !manifest.network.sensor) {
    losses.fault("one of adversarial, flow, reconstruction, volume, count, overlap above 0",
                 "all 0");
  }
}

/// A sensor's threshold must be known where the network is to learn it, and is of no use elsewhere.
void check_sensor(StrictObject& object, const TrainingManifest& manifest) {
  const bool wanted = manifest.network.sensor;
  const auto check = [&](const char* key, const std::vector<RecordingSpec>& specs) {
    const auto wrong = std::ranges::find_if(
        specs, [&](const RecordingSpec& spec) { return spec.threshold.has_value() != wanted; });
    if (wrong == specs.end()) return;
    object.at(key).fault(wanted ? "a threshold of each recording, since network.sensor"
                                : "no threshold, unless network.sensor",
                         (wanted ? "none of " : "that of ") + wrong->path);
  };
  check("recordings", manifest.recordings);
  if (!manifest.validation.empty()) check("validation", manifest.validation);
}

void read_training_output(const StrictValue& value, TrainingManifest& manifest) {
  StrictObject object = value.object();
  manifest.output_directory = read_path(object.at("directory"));
  if (const auto minutes = object.find("checkpoint_minutes")) {
    manifest.checkpoint_minutes = minutes->number(0, kMostMinutes);
  }
  if (const auto minutes = object.find("image_minutes")) {
    manifest.image_minutes = minutes->number(0, kMostMinutes);
  }
  object.finish();
}

TrainingManifest read_training_document(const StrictValue& document) {
  TrainingManifest manifest;
  StrictObject object = document.object();
  if (!object.has_format(kTrainingFormat, kTrainingVersion)) return manifest;
  manifest.name = read_name(object.at("name"));
  if (const auto seed = object.find("seed")) manifest.seed = read_seed(*seed);
  manifest.recordings = read_recordings(object.at("recordings"), 1);
  if (const auto validation = object.find("validation")) {
    manifest.validation = read_recordings(*validation, 0);
  }
  const auto simulated = object.find("simulated");
  if (simulated) manifest.simulated = read_simulated(*simulated);
  const auto teacher = object.find("teacher");
  if (teacher) manifest.teacher = read_path(*teacher);
  if (const auto gaps = object.find("gaps")) manifest.gaps = read_gaps(*gaps, PairSide::kBefore);
  const auto losses = object.find("losses");
  if (losses) manifest.losses = read_losses(*losses);
  const bool adversarial = manifest.losses.adversarial > 0;
  if (const auto crop = object.find("crop")) manifest.crop = read_crop(*crop, adversarial);
  if (const auto batch = object.find("batch")) manifest.batch = read_batch(*batch, adversarial);
  if (const auto network = object.find("network")) manifest.network = read_network(*network);
  if (const auto flip = object.find("label_flip")) manifest.label_flip = flip->number(0, 1);
  if (const auto steps = object.find("discriminator_steps")) {
    manifest.discriminator_steps = steps->integer(1, 10);
  }
  if (const auto augmentation = object.find("augmentation")) {
    manifest.augmentation = read_augmentation(*augmentation);
  }
  if (const auto optimizer = object.find("optimizer")) {
    manifest.optimizer = read_optimizer(*optimizer);
  }
  if (const auto precision = object.find("precision")) {
    manifest.precision = precision->choice(kTrainingPrecisionWords);
  }
  const StrictValue steps = object.at("steps");
  manifest.steps = read_steps(steps);
  read_training_output(object.at("output"), manifest);
  check_sensor(object, manifest);
  object.finish();
  check_phases(steps, losses.value_or(steps), manifest);
  for (const auto& key : {simulated, teacher}) {
    if (key && !manifest.network.sensor) key->fault("network.sensor with it", "none");
  }
  return manifest;
}

}  // namespace

TrainingManifest parse_training_manifest(std::string_view text,
                                         const std::filesystem::path& directory,
                                         const std::string& name) {
  return parse_manifest<TrainingManifest>(text, directory, name, read_training_document);
}

TrainingManifest read_training_manifest(const std::filesystem::path& file) {
  return parse_training_manifest(read_manifest_text(file), manifest_folder(file), file.string());
}

}  // namespace eventgan
