#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/generators.h"
#include "pipeline/realism/real_interval.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// Something that makes event volumes of frames, to be compared with a camera's.
class VolumeMethod {
 public:
  virtual ~VolumeMethod() = default;

  virtual std::string name() const = 0;      ///< a word: "network", "difference", "esim"
  virtual std::string settings() const = 0;  ///< what its volumes depend on, for the report
  virtual int draws() const = 0;             ///< volumes for an interval; above 1 if it is random

  /// Volume number `draw`: [2 bins, y, x] float32, ≥ 0, normalised (a simulator's counts
  /// divided by their η98, the network's values as it gives them). Thread safe.
  virtual std::vector<float> volume(const IntervalFrames& frames, int draw) const = 0;
};

/// The generator as "network": the frames go in as they are, at their own size, in [-1, 1].
/// `weights` is stated in the report. A network that knows its sensor is told `threshold`, `fitted`
/// or not, and gives events drawn by the seed (draw_events); others are told none.
std::unique_ptr<VolumeMethod> make_network_method(std::unique_ptr<Generator> generator,
                                                  const std::string& weights,
                                                  std::optional<ContrastThreshold> threshold,
                                                  bool fitted, std::uint64_t seed);

/// A network, and the SHA-256 of its weights' file.
struct NamedNetwork {
  std::unique_ptr<Generator> generator;
  std::string weights_hash;
};

/// That of a safetensors file, of "shipped" or of "shipped:WIDTH". Throws InputError if
/// the weights cannot be read or are not shipped, UsageError for another WIDTH than 1..64 and for
/// "untrained:WIDTH".
NamedNetwork open_network(const std::string& weights);

/// A model of a moving scene that a simulated sensor looks at.
struct SimulatedScene {
  std::string name;
  /// Pixel by pixel, as pixel_events.
  std::function<std::vector<Event>(const IntervalFrames&, const SensorSpec&, CounterRandom)> events;
  int draws = 1;
};

/// A simulator of kGenerators, called by its word. One that moves_one_frame moves it by at most
/// `displacement_px` a frame, and draws `draws` times.
SimulatedScene simulated_scene(GeneratorKind kind, double displacement_px = 0, int draws = 1);

/// The sensor of a threshold; its spread over the pixels is 15 % of the lower polarity's, as in
/// SensorSpec's defaults; no refractory time and no noise.
SensorSpec realism_sensor(const ContrastThreshold& threshold, double log_epsilon);

/// A model with a sensor; `fitted` is stated in the report. Volumes of `bins` bins; random numbers
/// by seed, name, interval and draw.
std::unique_ptr<VolumeMethod> make_simulated_method(SimulatedScene scene, const SensorSpec& sensor,
                                                    bool fitted, int bins, std::uint64_t seed);

/// Events of a pair by polarity, positive first.
using PolarityCounts = std::array<double, 2>;

/// Of each pair of frames what the model makes, the mean of the draws; of a network that knows its
/// sensor, the sum of its rates. They do not depend on `threads`.
std::vector<PolarityCounts> made_events(const SimulatedScene& scene,
                                        std::span<const IntervalFrames> frames,
                                        const SensorSpec& sensor, std::uint64_t seed, int threads);
std::vector<PolarityCounts> made_events(const Generator& generator,
                                        std::span<const IntervalFrames> frames,
                                        const ContrastThreshold& threshold, int threads);

inline constexpr double kLeastFittedThreshold = 0.01;
inline constexpr double kMostFittedThreshold = 5;

/// Whether a threshold that was looked for in a range is where the range ends, within 1 %: none in
/// it fits.
bool is_at_end(double threshold, const ThresholdRange& range);

/// The threshold in 0.01..5 with which made(threshold) events are as many as wanted, within 0.5 %
/// or as near as it gets: by bisection, since a higher threshold makes fewer events.
double fitted_threshold(double wanted, const std::function<double(double threshold)>& made);

/// That with which the model makes as many events as the camera did, over all of `frames` and the
/// mean of the draws. The result does not depend on `threads`.
double fitted_threshold(const SimulatedScene& scene, std::span<const IntervalFrames> frames,
                        double log_epsilon, std::uint64_t seed, int threads);

/// The same through a network that knows its sensor: with which its rates add up to the camera's
/// events of either polarity.
ContrastThreshold fitted_threshold(const Generator& generator,
                                   std::span<const IntervalFrames> frames, int threads);

}  // namespace eventgan
