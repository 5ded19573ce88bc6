#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "manifests/values/recording_formats.h"
#include "manifests/values/sensor_input.h"

namespace eventgan {

/// A recording that training or validation draws frame pairs from.
struct RecordingSpec {
  std::string path;                       ///< as written in the manifest
  std::optional<RecordingFormat> format;  ///< none: found out
  RecordingOptions options;
  double weight = 1;                       ///< relative chance of a sample to come from here, > 0
  std::int64_t first_frame = 0;            ///< frames before are not used
  std::optional<std::int64_t> last_frame;  ///< frames after are not used; none: to the end
  /// The sensor's in the frames' log intensity, mean 0.01..5, ratio 0.2..5; NetworkSpec::sensor
  /// needs it.
  std::optional<ContrastThreshold> threshold;
  bool operator==(const RecordingSpec&) const = default;
};

/// Where the generator has spectral norm: on residual blocks and decoders as in the published code,
/// on the encoders as the paper says, or nowhere.
enum class SpectralNormPlace { kDecoders, kEncoders, kNone };

struct NetworkSpec {
  int generator_channels = 32;      ///< base width, 1..64
  int discriminator_channels = 64;  ///< first width, 1..128
  int cycle_channels = 32;          ///< base width of flow and reconstruction network, 1..64
  SpectralNormPlace spectral_norm = SpectralNormPlace::kDecoders;
  int bins = 9;  ///< per polarity, 1..64
  /// Of the generator's last layer below zero as its phase begins, 0..1, falling to 0 until half of
  /// it: a channel that gives nothing gets no gradient from a slope of 0, as published, and stays
  /// dead; but with a slope sums over time are none of what `convert` will write.
  double output_slope = 0;
  /// Above 0 the generator's first layer learns weights of (previous + next) / 2 and of this many
  /// times next - previous, for those of previous and next. The networks that can be learned are
  /// the same, but small changes, which events come of, weigh as much as brightness. Weights are
  /// written for the frames.
  double difference_gain = 0;
  /// The generator sees the sensor's threshold too (sensor_input.h) and learns rates of events, by
  /// LossWeights::likelihood; without it, normalised volumes of the frames.
  bool sensor = false;
};

/// Pairs of scenes that no camera saw: planes with the images' textures before a simulated sensor
/// (moving_planes.h), each made when it is needed.
struct SimulatedSpec {
  std::vector<std::string> textures;  ///< folders of images, as written in the manifest
  double fraction = 0.5;              ///< share of samples, 0..1
};

/// Factors of the generator's losses, kLossTerms; 0 switches one off. The paper's ablations set one
/// of the first three to 0.
struct LossWeights {
  double adversarial = 1;
  double flow = 1;
  double reconstruction = 1;
  double volume = 0;
  double count = 0;
  double overlap = 0;
  double likelihood = 0;
  double block_likelihood = 0;
  double quantile = 0.5;    ///< of volume and count, 0.01..0.99; 0.5: mean |generated - real|
  double smoothness = 0.5;  ///< of the flow loss
};

/// What a loss compares the generated volume with.
enum class LossKind {
  kPaper,   ///< nothing: what the paper's other networks say of it; not with NetworkSpec::sensor
  kDirect,  ///< the real volume, for short trainings. With NetworkSpec::sensor these fade to 0 over
            ///< the generator's steps: they teach it sooner where and when events happen, but their
            ///< best volumes are not the rates
  kRates    ///< the events that happened, of which it says the rates; with NetworkSpec::sensor
};

/// A loss of the generator. Its function is in stages/training/update_loss.cc.
struct LossTerm {
  std::string_view word;  ///< in manifests and in reports
  double LossWeights::*weight;
  LossKind kind;
  std::string_view what;  ///< in a line, for people
};

inline constexpr std::array kLossTerms{
    LossTerm{"adversarial", &LossWeights::adversarial, LossKind::kPaper,
             "Of the discriminator's judgement."},
    LossTerm{"flow", &LossWeights::flow, LossKind::kPaper,
             "Of the flow that the frozen flow network sees in the generated volume."},
    LossTerm{"reconstruction", &LossWeights::reconstruction, LossKind::kPaper,
             "Of the next frame that the frozen reconstruction network makes with it."},
    LossTerm{"volume", &LossWeights::volume, LossKind::kDirect,
             "Of the difference to the real volume, voxel by voxel; not in the paper."},
    LossTerm{"count", &LossWeights::count, LossKind::kDirect,
             "Of the difference to the real volume, both summed over time; not in the paper."},
    LossTerm{"overlap", &LossWeights::overlap, LossKind::kDirect,
             "Of where events are, voxel by voxel and summed over time: 1 - F1 with the real "
             "volume's, made smooth; not in the paper."},
    LossTerm{"likelihood", &LossWeights::likelihood, LossKind::kRates,
             "With network.sensor: of how unlikely the real volume is where the generated one is "
             "the number of events to be expected; not in the paper."},
    LossTerm{"block_likelihood", &LossWeights::block_likelihood, LossKind::kRates,
             "With network.sensor: the same of the sums over blocks of 8x8 pixels. It keeps the "
             "number of events right beside volume, count and overlap."}};

/// Whether a loss of this kind is switched on.
constexpr bool has_loss(const LossWeights& weights, LossKind kind) {
  return std::ranges::any_of(kLossTerms, [&](const LossTerm& term) {
    return term.kind == kind && weights.*term.weight != 0;
  });
}

struct AugmentationSpec {
  bool flip = true;                      ///< left-right and up-down, each with probability 1/2
  bool reverse = false;                  ///< time runs backwards, with probability 1/2
  std::array<double, 2> gain = {1, 1};   ///< factor on the network's images, drawn uniformly
  std::array<double, 2> gamma = {1, 1};  ///< exponent on the network's images
  double static_fraction = 0;  ///< share of samples whose frames are one frame twice and whose
                               ///< volume is empty, 0..1; not in the paper
  double event_fraction = 0;   ///< share of samples whose crop holds an event drawn from all of the
                               ///< pair's, so that it lies where much happens, 0..1
};

struct OptimizerSpec {
  double generator_rate = 2e-4;
  double cycle_rate = 2e-4;
  double discriminator_rate = 5e-5;
  std::array<double, 2> betas = {0, 0.999};
  double final_rate_fraction = 1;  ///< rates fall to this share over each phase, by half a cosine;
                                   ///< 1 = constant, as in the paper
};

enum class TrainingPrecision { kFloat32, kBfloat16 };

/// The paper's three phases, in this order; each phase's networks are frozen in those after it.
enum class TrainingPhase { kFlow, kReconstruction, kGenerator };

/// The next step of a training: phase and step within it. A phase that is complete has `step` equal
/// to its number of steps.
struct TrainingPosition {
  TrainingPhase phase = TrainingPhase::kFlow;
  std::int64_t step = 0;
  auto operator<=>(const TrainingPosition&) const = default;
};

/// Steps of each phase; a step is one update of one network. In the generator phase
/// `discriminator_steps` updates of the discriminator go before each update of the generator
/// (none without adversarial loss), all counted.
struct PhaseSteps {
  std::int64_t flow = 0;
  std::int64_t reconstruction = 0;
  std::int64_t generator = 0;
};

/// A job of `eventgan train`, as manifests/schemas/training.schema.json describes it.
struct TrainingManifest : ManifestOrigin {
  std::string name;
  std::uint64_t seed = 0;
  std::vector<RecordingSpec> recordings;
  std::vector<RecordingSpec> validation;   ///< may be empty
  std::optional<SimulatedSpec> simulated;  ///< with NetworkSpec::sensor
  /// Weights, as written in the manifest, of a network that has learnt the same: with
  /// NetworkSpec::sensor the likelihoods are of its rates in place of the events (Hinton et al.
  /// 2015, distillation).
  std::optional<std::string> teacher;
  std::vector<int> gaps = {1, 2, 3, 4, 5, 6};
  ImageSize crop = {256, 256};  ///< sides 16..2048; from 48 with adversarial loss
  int batch = 8;                ///< 1..512, even with adversarial loss
  NetworkSpec network;
  LossWeights losses;
  double label_flip = 0.1;      ///< probability that a discriminator's label is flipped
  int discriminator_steps = 2;  ///< 1..10
  AugmentationSpec augmentation;
  OptimizerSpec optimizer;
  TrainingPrecision precision = TrainingPrecision::kFloat32;
  PhaseSteps steps;
  std::string output_directory;
  double checkpoint_minutes = 5;
  double image_minutes = 10;
};

std::string_view to_string(RecordingFormat format);
std::string_view to_string(SpectralNormPlace place);
std::string_view to_string(TrainingPrecision precision);
std::string_view to_string(TrainingPhase phase);

}  // namespace eventgan
