#include "manifests/documents/training_manifest.h"

#include <fmt/format.h>

#include <algorithm>

#include "manifests/documents/detail/document_tables.h"
#include "manifests/documents/detail/fields.h"
#include "manifests/documents/detail/manifest_file.h"
#include "manifests/values/words.h"

namespace eventgan {
namespace {

// As for conversion: below 16 pixels the generator's four halvings leave nothing of the image.
constexpr int kSmallestCrop = 16;
constexpr int kLargestCrop = 2048;
// The discriminator halves an image four times and then takes a pixel off twice.
constexpr int kSmallestAdversarialCrop = 48;

constexpr std::int64_t kMostFrames = 1'000'000'000;
constexpr std::int64_t kMostSteps = 1'000'000'000;

Numbers minutes() { return numbers(0, 1e6); }
// Rates and factors beyond these are slips of the pen.
Numbers rates() { return numbers(1e-9, 1); }
Numbers factors() { return numbers(0, 1e6); }
Numbers shares() { return numbers(0, 1); }

/// "mvsec: HDF5 as ... write it. eventgan: ..."
std::string summaries() {
  std::string text;
  for (const RecordingFormatRow& row : kFrameFormats) {
    text += fmt::format("{}{}: {}.", text.empty() ? "" : " ", row.word, row.summary);
  }
  return text;
}

void list_recording(Fields& fields, RecordingSpec& spec) {
  fields.at("path", spec.path, paths(), "The file; for ecd a folder.");
  RecordingFormat format = spec.format.value_or(RecordingFormat::kMvsec);
  fields.kind_at("format", format, words(kFrameFormatWords), summaries());
  spec.format = format;
  Fields::Only some = fields.taken_by(kFrameFormats);
  some.find("camera", spec.options.camera, stereo_cameras(), "which of the two cameras.");
  some.find("rectify", spec.options.rectify, booleans(), "moves events by its rectify_map.h5.");
  fields.find("weight", spec.weight, numbers(1e-6, 1e6),
              "Relative chance of a sample to come from here.");
  fields.find("first_frame", spec.first_frame, integers(0, kMostFrames),
              "Frames before this one are not used, counted from 0.");
  const auto last = fields.find("last_frame", spec.last_frame, integers(1, kMostFrames),
                                "Frames after this one are not used. Default: the last one.");
  if (last && fields.is_sound("last_frame") && *spec.last_frame <= spec.first_frame) {
    last->fault("a frame after first_frame (" + std::to_string(spec.first_frame) + ")");
  }
  std::optional<double> threshold;
  double ratio = ContrastThreshold().ratio;
  fields.find("threshold", threshold, numbers(0.01, 5),
              "The camera's contrast threshold in the frames' log intensity ln(u/255 + 0.02), the "
              "geometric mean of both polarities'. With network.sensor, and then of each "
              "recording.");
  fields.find("threshold_ratio", ratio, numbers(0.2, 5),
              "Of the threshold of negative events to that of positive ones.");
  fields.needs("threshold_ratio", "threshold");
  if (threshold) spec.threshold = ContrastThreshold{*threshold, ratio};
}

void list_simulated(Fields& fields, SimulatedSpec& spec) {
  fields.at("textures", spec.textures, lists(paths(), 1),
            "Folders of images, searched with their subfolders; of more than 256 images these many "
            "are used, evenly spread.");
  fields.find("fraction", spec.fraction, shares(), "Share of samples that are simulated.");
}

void list_network(Fields& fields, NetworkSpec& spec) {
  fields.find("generator_channels", spec.generator_channels, integers(1, 64),
              "Base width of the generator.");
  fields.find("discriminator_channels", spec.discriminator_channels, integers(1, 128),
              "First width of the discriminator.");
  fields.find("cycle_channels", spec.cycle_channels, integers(1, 64),
              "Base width of flow and reconstruction network.");
  fields.find("spectral_norm", spec.spectral_norm, words(kSpectralNormWords),
              "Where the generator has spectral norm. decoders: on residual blocks and decoders, "
              "as the published code. encoders: as the paper says.");
  fields.find("output_slope", spec.output_slope, numbers(0, 1),
              "Slope of the generator's last layer below zero as its phase begins, falling to 0 "
              "until half of it. 0: as published; a channel that gives nothing gets no gradient "
              "then and stays dead.");
  fields.find("difference_gain", spec.difference_gain, numbers(0, 1000),
              "Above 0 the generator's first layer learns weights of (previous + next) / 2 and of "
              "this many times next - previous, for those of previous and next: the same networks, "
              "learned sooner. 0: as published.");
  fields.find("sensor", spec.sensor, booleans(),
              "The generator gets the sensor's contrast threshold: it sees the change of log "
              "intensity in thresholds beside the two frames, and learns the number of events to "
              "be expected, by losses.likelihood. false: as published, normalised volumes of the "
              "frames.");
  fields.find("bins", spec.bins, integers(1, 64), "Time bins per polarity.");
}

void list_losses(Fields& fields, LossWeights& losses) {
  for (const LossTerm& term : kLossTerms) {
    fields.find(term.word, losses.*term.weight, factors(), term.what);
  }
  fields.find("quantile", losses.quantile, numbers(0.01, 0.99),
              "Of the losses volume and count: 0.5 is the mean absolute difference, more asks for "
              "events where they are less likely.");
  fields.find("smoothness", losses.smoothness, factors(),
              "Of the flow's smoothness within the flow loss.");
}

void list_augmentation(Fields& fields, AugmentationSpec& spec) {
  fields.find("flip", spec.flip, booleans(),
              "Left-right and up-down, each for half of the samples.");
  fields.find("reverse", spec.reverse, booleans(),
              "Time runs backwards for half of the samples: frames and polarities change places, "
              "the first bin is the last; not in the paper.");
  fields.find("gain", spec.gain, pairs_of(0.1, 10),
              "Range of a factor on the images that the networks see.");
  fields.find("gamma", spec.gamma, pairs_of(0.1, 10),
              "Range of an exponent on the images that the networks see.");
  fields.find("static_fraction", spec.static_fraction, shares(),
              "Share of samples that are one frame twice and have an empty volume; not in the "
              "paper.");
  fields.find("event_fraction", spec.event_fraction, shares(),
              "Share of samples whose crop holds an event drawn from all of the pair's, so that it "
              "lies where much happens; not in the paper.");
}

void list_optimizer(Fields& fields, OptimizerSpec& spec) {
  fields.find("generator_rate", spec.generator_rate, rates(), "Learning rate of the generator.");
  fields.find("cycle_rate", spec.cycle_rate, rates(),
              "Learning rate of flow and reconstruction network.");
  fields.find("discriminator_rate", spec.discriminator_rate, rates(),
              "Learning rate of the discriminator.");
  fields.find("betas", spec.betas, pairs_of(0, 0.999999, Ends::kAnyOrder),
              "Decay of the two moments.");
  fields.find("final_rate_fraction", spec.final_rate_fraction, shares(),
              "Rates fall to this share over each phase, by half a cosine; 1 = constant.");
}

void list_steps(Fields& fields, PhaseSteps& steps) {
  fields.find("flow", steps.flow, integers(0, kMostSteps), "Of the flow network.");
  fields.find("reconstruction", steps.reconstruction, integers(0, kMostSteps),
              "Of the reconstruction network.");
  fields.find("generator", steps.generator, integers(0, kMostSteps),
              "Of discriminator and generator together.");
}

void list_training_output(Fields& fields, TrainingManifest& manifest) {
  fields.at("directory", manifest.output_directory, paths(),
            "Folder of checkpoints, curves, images and the weights; made if it is absent.");
  fields.find("checkpoint_minutes", manifest.checkpoint_minutes, minutes(),
              "Time between checkpoints; 0: after each step.");
  fields.find("image_minutes", manifest.image_minutes, minutes(),
              "Time between images of generated and real volumes; one more is drawn after the last "
              "step. 0: after each step.");
}

std::vector<std::string_view> loss_words(std::initializer_list<LossKind> kinds) {
  std::vector<std::string_view> found;
  for (const LossTerm& term : kLossTerms) {
    if (std::ranges::find(kinds, term.kind) != kinds.end()) found.push_back(term.word);
  }
  return found;
}

/// The generator learns through the frozen flow and reconstruction network, so they must have been
/// trained; and from something at all.
void check_phases(const StrictValue& steps, const StrictValue& losses,
                  const TrainingManifest& manifest) {
  using enum LossKind;
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
  const bool sensor = manifest.network.sensor;
  if (sensor && (has_loss(factor, kPaper) || factor.likelihood == 0)) {
    losses.fault(fmt::format("likelihood above 0 and {} 0, since network.sensor",
                             fmt::join(loss_words({kPaper}), ", ")),
                 "others");
  } else if (!sensor && has_loss(factor, kRates)) {
    losses.fault(
        fmt::format("{} 0, unless network.sensor", fmt::join(loss_words({kRates}), " and ")),
        "others");
  } else if (!sensor && !has_loss(factor, kPaper) && !has_loss(factor, kDirect)) {
    losses.fault(fmt::format("one of {} above 0", fmt::join(loss_words({kPaper, kDirect}), ", ")),
                 "all 0");
  }
}

/// A sensor's threshold must be known where the network is to learn it, and is of no use elsewhere.
void check_thresholds(const StrictValue& recordings, const std::vector<RecordingSpec>& specs,
                      bool wanted) {
  const auto wrong = std::ranges::find_if(
      specs, [&](const RecordingSpec& spec) { return spec.threshold.has_value() != wanted; });
  if (wrong == specs.end()) return;
  recordings.fault(wanted ? "a threshold of each recording, since network.sensor"
                          : "no threshold, unless network.sensor",
                   (wanted ? "none of " : "that of ") + wrong->path);
}

/// What a schema can say of the rules above.
Fields::Schema sensor_rule() {
  const auto each = [](const std::vector<std::string_view>& words, const Schema& schema) {
    Schema properties = Schema::object();
    for (const std::string_view word : words) properties[std::string(word)] = schema;
    return properties;
  };
  const Schema zero = {{"maximum", 0}}, above = {{"exclusiveMinimum", 0}};
  const Schema trains_generator = {
      {"properties",
       {{"steps",
         {{"required", Schema::array({"generator"})}, {"properties", {{"generator", above}}}}}}}};
  Schema with_sensor = each(loss_words({LossKind::kPaper}), zero);
  Schema needed = Schema::array({"likelihood"});
  for (const std::string_view word : loss_words({LossKind::kPaper})) needed.push_back(word);
  with_sensor["likelihood"] = above;
  const auto recordings = [&](const Schema& items) {
    return each({"recordings", "validation"}, {{"items", items}});
  };
  Schema without = recordings({{"properties", {{"threshold", false}}}});
  without["simulated"] = false;
  without["teacher"] = false;
  return {{"if",
           {{"required", Schema::array({"network"})},
            {"properties",
             {{"network",
               {{"required", Schema::array({"sensor"})},
                {"properties", {{"sensor", {{"const", true}}}}}}}}}}},
          {"then",
           {{"properties", recordings({{"required", Schema::array({"threshold"})}})},
            {"if", trains_generator},
            {"then",
             {{"required", Schema::array({"losses"})},
              {"properties", {{"losses", {{"required", needed}, {"properties", with_sensor}}}}}}}}},
          {"else",
           {{"properties", without},
            {"if", trains_generator},
            {"then",
             {{"properties",
               {{"losses", {{"properties", each(loss_words({LossKind::kRates}), zero)}}}}}}}}}};
}

}  // namespace

void list_training(Fields& fields, TrainingManifest& manifest) {
  if (!fields.has_format("eventgan-training", 1)) return;
  fields.at("name", manifest.name, names(),
            "Name of the training, the first part of its weights' file name.");
  fields.find("seed", manifest.seed, seeds(), kSeedField);
  const auto recordings =
      fields.at("recordings", manifest.recordings, lists(objects(list_recording), 1),
                "What samples are drawn from.");
  const auto validation =
      fields.find("validation", manifest.validation, lists(objects(list_recording), 0),
                  "What is never trained on: the images during training show it.");
  const auto simulated =
      fields.find("simulated", manifest.simulated, objects(list_simulated),
                  "Samples of scenes that no camera saw, each made when it is needed: planes with "
                  "the images' textures move before a simulated sensor, whose threshold is drawn "
                  "from 0.0675 to 0.88. With network.sensor only.");
  const auto teacher =
      fields.find("teacher", manifest.teacher, paths(),
                  "Weights of a network that has learnt the same, often a wider one: likelihood "
                  "and block_likelihood are of its rates in place of the recorded events. With "
                  "network.sensor only.");
  fields.find("gaps", manifest.gaps, Gaps(),
              "Distances between the two frames of a sample, counted in frames, drawn alike.");
  const auto losses = fields.find(
      "losses", manifest.losses, objects(list_losses),
      "Factors of the generator's losses; 0 switches one off. At least one of the first six is "
      "above 0. With network.sensor the first three are 0 and likelihood is above 0; volume, count "
      "and overlap fade to 0 over the steps.");
  const bool adversarial = fields.is_reading() && manifest.losses.adversarial > 0;
  fields.find("crop", manifest.crop,
              sizes(adversarial ? kSmallestAdversarialCrop : kSmallestCrop, kLargestCrop),
              "Size of the random crops in pixels. With adversarial loss at least 48 a side, for "
              "the discriminator.");
  const auto batch = fields.find("batch", manifest.batch, integers(1, 512),
                                 "Samples of a step; even with adversarial loss.");
  if (batch && adversarial && fields.is_sound("batch") && manifest.batch % 2 != 0) {
    batch->fault("an even batch, since losses.adversarial > 0");
  }
  fields.find("network", manifest.network, objects(list_network), "The networks' sizes.");
  fields.find("label_flip", manifest.label_flip, shares(),
              "Probability that a label of the discriminator is flipped.");
  fields.find("discriminator_steps", manifest.discriminator_steps, integers(1, 10),
              "Updates of the discriminator before each of the generator.");
  fields.find("augmentation", manifest.augmentation, objects(list_augmentation),
              "What is done to samples at random beside the crop.");
  fields.find("optimizer", manifest.optimizer, objects(list_optimizer), "Settings of RAdam.");
  fields.find("precision", manifest.precision, words(kTrainingPrecisionWords),
              "Arithmetic of the networks; weights and losses are always float32.");
  const auto steps = fields.at(
      "steps", manifest.steps, objects(list_steps),
      "Updates in each phase, in this order. A generator that learns from the flow or the "
      "reconstruction loss needs steps of that phase; some phase has more than 0.");
  fields.at("output", manifest, objects(list_training_output), "The files that are made.");
  if (!fields.is_reading()) return fields.rule(sensor_rule());
  check_thresholds(*recordings, manifest.recordings, manifest.network.sensor);
  if (validation) check_thresholds(*validation, manifest.validation, manifest.network.sensor);
  fields.finish();
  check_phases(*steps, losses.value_or(*steps), manifest);
  for (const auto& key : {simulated, teacher}) {
    if (key && !manifest.network.sensor) key->fault("network.sensor with it", "none");
  }
}

TrainingManifest parse_training_manifest(std::string_view text,
                                         const std::filesystem::path& directory,
                                         const std::string& name) {
  return parse_manifest<TrainingManifest>(text, directory, name, list_training);
}

TrainingManifest read_training_manifest(const std::filesystem::path& file) {
  return parse_training_manifest(read_manifest_text(file), manifest_folder(file), file.string());
}

}  // namespace eventgan
