#pragma once

#include <span>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/sensor_input.h"
#include "stages/events/simulation/plane_scene.h"

namespace eventgan {

/// What a simulated camera saw between two frames of a scene of moving planes.
struct SimulatedPair {
  GreyImage previous;         ///< at 0 s
  GreyImage next;             ///< at duration_s
  std::vector<Event> events;  ///< in (0, duration_s], ordered as Sensor::step orders them
  double duration_s = 0;
  /// The sensor's contrast thresholds in units of the frames' log intensity. A frame shows
  /// u = 255 gain I^gamma of the light I, so ln u moves gamma times as far as ln I, and
  ///   threshold = gamma √(C₊ C₋), of a ratio C₋/C₊.
  ContrastThreshold threshold;

  bool operator==(const SimulatedPair&) const = default;
};

/// Where the mean of SimulatedPair::threshold lies in the scenes that draw_plane_scene draws.
inline constexpr ThresholdRange kPlaneThresholds{0.0675, 0.88};

/// Renders a scene and shows it to a Sensor, in steps in which nothing moves much farther than
/// 0.7 px (up to 64 of them from frame to frame).
///
/// - Events: those of the light between the frames' times. Each pixel starts at a distance from its
///   level that is drawn per pixel, triangular within ± level_spread thresholds: a camera was on
///   before. Before the sensor the intensity passes a first-order low-pass,
///   dV/dt = 2π cutoff_hz (I - V), exact for an intensity that is linear from step to step.
/// - Frames: mean of the intensity over the exposure, which is centred on the frame's time, so half
///   of it lies outside the interval; then
///     u = round(255 clip(gain I^gamma, 0, 1) + read noise), clipped to 0..255.
///
/// A function of its arguments alone. Throws std::invalid_argument if the scene has no plane or no
/// pixel, its duration is not above 0, or a texture is empty or not there; std::runtime_error if
/// OpenCV fails. Thread safe.
SimulatedPair simulate_plane_scene(const PlaneScene& scene, std::span<const GreyImage> textures,
                                   CounterRandom random);

/// A scene of draw_plane_scene, simulated. Throws as both do. Thread safe.
SimulatedPair simulate_planes(std::span<const GreyImage> textures, ImageSize size,
                              CounterRandom random);

}  // namespace eventgan
