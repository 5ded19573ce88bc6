#include "manifests/training_manifest.h"

#include "manifests/manifest_text_internal.h"
#include "manifests/parse_manifest_internal.h"
#include "manifests/source_spec_internal.h"
#include "manifests/training_settings_internal.h"
#include "manifests/training_words_internal.h"

namespace eventgan {
namespace {

constexpr std::string_view kTrainingFormat = "eventgan-training";
constexpr int kTrainingVersion = 1;

// As for conversion: below 16 pixels the generator's four halvings leave nothing of the picture.
constexpr int kSmallestCrop = 16;
constexpr int kLargestCrop = 2048;
// The discriminator halves a picture four times and then takes a pixel off twice.
constexpr int kSmallestAdversarialCrop = 48;

constexpr double kMostMinutes = 1e6;

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
    steps.fault("more than 0 steps in some phase", "none");
  }
  if (count.generator == 0) return;
  const auto check = [&](std::int64_t phase_steps, double loss, const std::string& name) {
    if (loss > 0 && phase_steps == 0) {
      steps.fault("steps." + name + " > 0 while losses." + name + " > 0", "0 steps");
    }
  };
  check(count.flow, factor.flow, "flow");
  check(count.reconstruction, factor.reconstruction, "reconstruction");
  if (factor.adversarial == 0 && factor.flow == 0 && factor.reconstruction == 0 &&
      factor.volume == 0 && factor.count == 0) {
    losses.fault("one of adversarial, flow, reconstruction, volume, count above 0", "all 0");
  }
}

void read_training_output(const StrictValue& value, TrainingManifest& manifest) {
  StrictObject object = value.object();
  manifest.output_directory = read_path(object.at("directory"));
  if (const auto minutes = object.find("checkpoint_minutes")) {
    manifest.checkpoint_minutes = minutes->number(0, kMostMinutes);
  }
  if (const auto minutes = object.find("picture_minutes")) {
    manifest.picture_minutes = minutes->number(0, kMostMinutes);
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
    manifest.precision = precision->choice(kPrecisionWords);
  }
  const StrictValue steps = object.at("steps");
  manifest.steps = read_steps(steps);
  read_training_output(object.at("output"), manifest);
  object.finish();
  check_phases(steps, losses.value_or(steps), manifest);
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

std::string_view to_string(RecordingFormat format) {
  return word_of(kRecordingFormatWords, format);
}
std::string_view to_string(SpectralNormPlace place) { return word_of(kSpectralNormWords, place); }
std::string_view to_string(TrainingPrecision precision) {
  return word_of(kPrecisionWords, precision);
}
std::string_view to_string(TrainingPhase phase) { return word_of(kPhaseWords, phase); }

}  // namespace eventgan
