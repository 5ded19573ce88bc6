#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/generator.h"

namespace eventgan {

// What of the network's shape (see Weights) does not depend on the weights.

inline constexpr int kNetworkLevels = 4;  ///< encoders, and as many decoders
inline constexpr int kResidualBlocks = 2;
inline constexpr float kLeakySlope = 0.01f;  ///< LeakyReLU turns x < 0 into this times x

/// Size of what an encoder makes of an image: both sides halved, rounded up.
constexpr ImageSize half_size(ImageSize size) {
  return {(size.height + 1) / 2, (size.width + 1) / 2};
}

/// One convolution of the folded network.
struct Convolution {
  std::string name;  ///< "head", "encoders.0" .. "decoders.3", "resblocks.0.conv1", "pred"
  int out_channels = 0;
  int in_channels = 0;
  int kernel = 0;  ///< side of the square kernel in pixels; padding is (kernel - 1) / 2
  int stride = 1;
  std::vector<float> weight;  ///< [out, in, y, x] float32, C order
  std::vector<float> bias;    ///< [out] float32
};

constexpr int kMostBaseChannels = 1024;  ///< of Weights::base_channels
constexpr int kMostWeightBins = 64;      ///< of Weights::bins

struct Calibration;  // calibration.h

/// The generator's network, spectral and batch norm folded into the convolutions, which all have a
/// bias, with the base width b:
///   head        3x3, inputs() → b, LeakyReLU
///   4 encoders  3x3, stride 2, b → 2b → 4b → 8b → 16b, LeakyReLU
///   2 resblocks 3x3, ReLU, 3x3 at 16b; the block's input is added, ReLU
///   4 decoders  doubled to the size of the matching encoder's input (nearest), then 3x3 over
///               [that, this input] to 8b, 4b, 2b, b, LeakyReLU
///   pred        1x1, b → 2 bins, ReLU
struct Weights {
  int base_channels = 0;
  int bins = 0;                                 ///< per polarity; the last layer has 2 bins outputs
  std::vector<Convolution> convolutions;        ///< in the order of network_layout()
  std::map<std::string, std::string> metadata;  ///< origin: where the numbers come from
  std::shared_ptr<const Calibration> calibration;        ///< what int8 needs; null: none
  std::optional<GapRange> training_gaps = std::nullopt;  ///< none: not known
  /// Of a network that knows its sensor: its inputs are sensor_input(), its values rates. None: its
  /// inputs are the frames, its values a normalised volume's.
  std::optional<ThresholdRange> thresholds = std::nullopt;

  int inputs() const { return thresholds ? 3 : 2; }
};

/// Names and shapes of the network's convolutions for a base width, without numbers: head,
/// encoders.0-3, resblocks.0-1.conv1-2, decoders.0-3, pred.
std::vector<Convolution> network_layout(int base_channels, int bins, int inputs = 2);

/// "trained on gaps 1-5" or "training gaps unknown"; for people.
std::string describe_training_gaps(const std::optional<GapRange>& gaps);

/// The planes that a network of these thresholds sees of a pair, [inputs, y, x] float32: the frames
/// themselves, or sensor_input(), which is put into `kept`; where the pair tells no threshold, for
/// the geometric mean of `thresholds`. Throws std::invalid_argument for a threshold that is not
/// above 0, and for any where there are no thresholds. Thread safe.
std::span<const float> network_planes(const GeneratorInput& pair,
                                      const std::optional<ThresholdRange>& thresholds,
                                      std::vector<float>& kept);

/// Bytes of the activations between the network's layers for one image, each held once, with
/// `value_bytes` a value, and of its input and output: what an engine that reuses nothing needs,
/// but for what it works on at the moment.
std::size_t activation_bytes(ImageSize size, int base_channels, std::size_t value_bytes);

/// Throws std::runtime_error "expected X, got Y, in NAME" unless the convolutions have exactly the
/// layout's names and shapes and all numbers are finite.
void check_weights(const Weights& weights, const std::string& name);

/// A network of random numbers, for trying the program before weights exist: its volumes mean
/// nothing as events. He initialisation (normal, σ² = 2/fan-in), biases zero; the same seed gives
/// the same numbers everywhere.
Weights untrained_weights(int base_channels, int bins, std::uint64_t seed);

}  // namespace eventgan
