#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "manifests/values/frames.h"
#include "manifests/values/sensor_input.h"

namespace eventgan {

/// One event of a recording.
struct Event {
  int x = 0;  ///< column, 0-based
  int y = 0;  ///< row, 0-based
  double t_s = 0;
  bool positive = true;
  bool operator==(const Event&) const = default;
};

/// The model of an event camera's pixel that the simulators share: it signals when the logarithm of
/// its intensity has moved by a contrast threshold since its last event (Rebecq et al., ESIM, 2018;
/// noise as in Hu et al., v2e, 2021). Logarithms are natural, of the linear intensity u/255 + ε.
struct SensorSpec {
  double positive_threshold = 0.2;  ///< mean contrast threshold of positive events, 0.01..5
  double negative_threshold = 0.2;  ///< the same of negative events, as a positive number
  double threshold_spread = 0.03;   ///< standard deviation over the pixels, log units, 0..1; drawn
                                    ///< per polarity; a pixel's threshold is never below 0.01
  double refractory_s = 0;          ///< a pixel is silent so long after an event, 0..1; what it
                                    ///< passes by then is lost, its level follows
  double leak_rate_hz = 0;          ///< positive events per pixel and second without any motion
  double shot_noise_rate_hz = 0;    ///< events of either polarity per pixel and second of black,
                                    ///< Poisson; the rate of one polarity is half of it, and of
                                    ///< white a quarter
  double hot_pixel_fraction = 0;    ///< share of pixels that are hot, 0..1
  double hot_pixel_rate_hz = 0;     ///< events per second of a hot pixel, Poisson, one polarity
  double log_epsilon = 0.001;       ///< ε, 1e-6..1: keeps the logarithm of black finite
  bool operator==(const SensorSpec&) const = default;
};

/// A contrast threshold that is drawn for each pair, for both polarities.
struct ThresholdSpec {
  /// Least and most, log units, 0.01..5; drawn log-uniformly.
  std::array<double, 2> range{0.2, 0.2};
  double ratio = 1;  ///< of the negative threshold to the positive one, 0.2..5
  /// Standard deviation over the pixels, 0..1; none: the share that it is of SensorSpec's defaults
  /// of the lower one of both polarities' thresholds, so that no pixel comes near zero.
  std::optional<double> spread = std::nullopt;
  bool operator==(const ThresholdSpec&) const = default;

  static constexpr double kSpreadShare = 0.15;
  static constexpr std::array<double, 2> kRatios{0.2, 5};

  /// The sensor with a threshold.
  SensorSpec applied(SensorSpec sensor, const ContrastThreshold& threshold) const {
    sensor.positive_threshold = threshold.positive();
    sensor.negative_threshold = threshold.negative();
    sensor.threshold_spread =
        spread.value_or(kSpreadShare * std::min(threshold.positive(), threshold.negative()));
    return sensor;
  }
};

/// Noise of an event camera, added to finished volumes (stages/events/noise.h), whatever made them.
/// Each number is drawn uniformly from [least, most] for each pair; zeros: no noise.
struct NoiseSpec {
  std::array<double, 2> shot_hz{};     ///< events per pixel and second, half of them of either
                                       ///< polarity; 0..kMostNoise_hz
  std::array<double, 2> leak_hz{};     ///< positive events per pixel and second, 0..kMostNoise_hz
  std::array<double, 2> hot_pixels{};  ///< share of the pixels that are hot, 0..1
  bool operator==(const NoiseSpec&) const = default;
};
inline constexpr double kMostNoise_hz = 1000;

/// A threshold of a network that knows its sensor: it is told another one than a model for as many
/// events, and one network another one than the next.
struct NetworkThreshold {
  std::string weights;  ///< SHA-256 of the weights' file
  ThresholdSpec threshold;
  bool operator==(const NetworkThreshold&) const = default;
};

/// An event camera as a document tells it (manifests/schemas/sensor.schema.json). Thresholds are of
/// ln(u/255 + kFrameLogEpsilon), without a spread.
struct CameraSensor {
  std::string name;                         ///< as JobManifest::name
  std::optional<ThresholdSpec> threshold;   ///< of the models difference and esim
  std::optional<NetworkThreshold> network;  ///< none: nobody has found it
  std::optional<NoiseSpec> noise;
  std::string origin;  ///< how the numbers were found, for people
  bool operator==(const CameraSensor&) const = default;
};

/// Shape of an event volume: [2 bins, height, width], C order. Channels 0..bins-1 are the positive
/// polarity in time order, bins..2 bins-1 the negative one.
struct VolumeShape {
  int bins = 0;
  ImageSize size;

  int channels() const { return 2 * bins; }
  std::size_t value_count() const {
    return static_cast<std::size_t>(channels()) * size.pixel_count();
  }
  bool operator==(const VolumeShape&) const = default;
};

/// What was noteworthy about a stored volume; bits of `/events/statistics/flags`.
enum VolumeFlag : std::uint32_t {
  kFlagEmpty = 1u << 0,         ///< no value is different from zero
  kFlagExtrapolated = 1u << 1,  ///< a gap that the generator never saw in training
  kFlagSaturated = 1u << 2,     ///< values beyond the stored type's range were clipped to it
  kFlagVanished = 1u << 3,      ///< all values became zeros in the stored type, too small for it
  /// more of the network's activations than kMostSaturated were clipped to what int8 was calibrated
  /// for
  kFlagBeyondCalibration = 1u << 4,
  kFlagNoise = 1u << 5,  ///< noise events were added to what the generator made (NoiseSpec)
};

/// Numbers about one volume as generated, before it is quantised for storage.
struct VolumeStatistics {
  float eta98 = 0;             ///< 98th percentile of the non-zero values; 0 if empty
  float max = 0;               ///< largest value
  float nonzero_fraction = 0;  ///< share of values that are not zero, 0..1
  double sum_positive = 0;     ///< sum over the positive-polarity channels
  double sum_negative = 0;     ///< sum over the negative-polarity channels
  std::uint32_t flags = 0;     ///< VolumeFlag bits
};

}  // namespace eventgan
