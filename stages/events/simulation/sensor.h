#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "stages/events/simulation/pixel_noise.h"

namespace eventgan {

/// The intensity a simulated sensor sees for an image: u/255, [y, x] float32 in [0, 1], C order.
/// Grey values are taken for linear intensity, as ESIM and v2e take them: a camera's gamma is not
/// undone, so contrasts are those of the image as it is stored. Throws std::invalid_argument if
/// the image is empty or its size and pixels disagree. Thread safe.
std::vector<float> linear_intensity(const GreyImage& image);

/// No pixel's contrast threshold is below this, however wide the spread.
inline constexpr float kSmallestThreshold = 0.01f;

/// Contrast thresholds of one polarity, one a pixel in C order: Gaussian (Box and Muller 1958)
/// about `mean` with standard deviation `spread`, raised to kSmallestThreshold where lower. Thread
/// safe.
std::vector<float> draw_thresholds(double mean, double spread, std::size_t pixel_count,
                                   CounterRandom random);

/// Memory for the events that a sensor gives in the dark without any motion, by leak and noise,
/// about and rather too little: pixels in an interval of `duration_s` > 0.
double idle_event_bytes(const SensorSpec& spec, std::size_t pixel_count, double duration_s);

/// Throws std::runtime_error naming the settings and the number of events where these do not fit
/// into `memory_bytes`.
void check_events_fit(const SensorSpec& spec, ImageSize size, double duration_s,
                      std::size_t memory_bytes);

/// How a pixel leaks.
struct PixelLeak {
  float rate = 1;   ///< of the sensor's mean
  float phase = 0;  ///< how far towards an event it is when it begins, 0..1
};

/// What a pixel of a Sensor remembers beside its log intensity.
struct PixelState {
  double difference = 0;    ///< d; 0 where the pixel is still held
  double held_until_s = 0;  ///< end of the last refractory time
};

/// The pixels of a simulated event camera, fed with intensity images at rising times. A pixel
/// remembers a level ℓ and compares with it the log intensity L = ln(I + ε), which moves on a
/// straight line from one image to the next (ESIM, Rebecq et al. 2018, eq. 2):
///
///   d(t) = L(t) - ℓ(t);   positive event where d rises to C₊, negative one where it falls to -C₋.
///
/// - Reset: every event of a pixel, noise included, sets its level to its log intensity, so after a
///   crossing the next is a full threshold away.
/// - Refractory time R: after an event at t the pixel is held in reset until t + R. Noise and
///   crossings in between are lost, and at t + R the level is L(t + R).
/// - Leak: the level of a pixel that is not held falls by C₊ · r a second (v2e, Hu et al. 2021), r
///   being the pixel's own rate, log-normal of mean leak_rate_hz: without motion a positive event
///   each 1/r (+ R) seconds. With a leak, a pixel begins anywhere between two events of it.
/// - Shot noise and hot pixels: see PixelNoise.
/// - Thresholds: see draw_thresholds, one draw a pixel and polarity.
///
/// All randomness is a function of `random` and of the pixel: the same images give the same
/// events. Not thread safe; one object a recording.
class Sensor {
 public:
  Sensor(const SensorSpec& spec, ImageSize size, CounterRandom random);

  /// intensity: [y, x] float32, C order, linear, in [0, 1]. The first call sets every pixel's level
  /// to what it sees and gives no events. Returns the events in (time before, t_s], ordered by
  /// time, then y, x, polarity (negative first). Throws std::invalid_argument, and changes nothing,
  /// if the time is not finite or does not rise, the size is another, or a value is not finite or
  /// below 0.
  std::vector<Event> step(std::span<const float> intensity, double t_s);

 private:
  void check(std::span<const float> intensity, double t_s) const;
  void start(std::span<const float> intensity, double t_s);

  SensorSpec spec_;
  ImageSize size_;
  CounterRandom random_;
  std::vector<float> positive_threshold_;
  std::vector<float> negative_threshold_;
  std::vector<PixelLeak> leak_;  ///< empty: there is none

  // State at time_s_; noise_ is set by the first image.
  double time_s_ = 0;
  std::optional<PixelNoise> noise_;
  std::vector<float> log_intensity_;
  std::vector<PixelState> pixels_;
};

/// Whether an event comes before another: by time, then y, x, polarity (negative first). Pure.
bool comes_before(const Event& left, const Event& right);

/// Writes row `row` of image number `image`: [x] float32, as Sensor::step takes it.
using IntensityRow = std::function<void(std::size_t image, int row, std::span<float> intensity)>;

/// The events of a Sensor that is shown images at `times_s`, two or more, one after the other:
/// the same events, but pixel by pixel in C order, and each pixel's by time. Nothing is kept for
/// pixels or sorted, and without leak and noise a pixel whose intensity stays within what its
/// threshold surely is above costs neither a logarithm nor a drawn threshold. Throws
/// std::invalid_argument if a time is not finite or does not rise. Thread safe.
std::vector<Event> pixel_events(const SensorSpec& spec, ImageSize size, const IntensityRow& images,
                                std::span<const double> times_s, CounterRandom random);

/// Of images that are seen as linear_intensity has them: as many as times, all of one size.
std::vector<Event> pixel_events(const SensorSpec& spec, std::span<const GreyImage> images,
                                std::span<const double> times_s, CounterRandom random);

}  // namespace eventgan
