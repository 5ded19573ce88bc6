#include "stages/events/simulation/plane_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stdexcept>
#include <string>

namespace eventgan {
namespace {

/// Draws one after another.
class Draws {
 public:
  explicit Draws(CounterRandom random) : random_(random) {}

  double uniform(double low, double high) {
    return low + (high - low) * random_.uniform(counter_++);
  }
  double log_uniform(double low, double high) { return low * std::pow(high / low, uniform(0, 1)); }
  bool chance(double probability) { return uniform(0, 1) < probability; }
  int between(int low, int high) {
    return low +
           static_cast<int>(random_.below(counter_++, static_cast<std::uint64_t>(high - low + 1)));
  }
  std::size_t below(std::size_t count) { return random_.below(counter_++, count); }
  PlanePoint direction(double length) {
    const double angle = uniform(0, 2 * std::numbers::pi);
    return {length * std::cos(angle), length * std::sin(angle)};
  }

 private:
  CounterRandom random_;
  std::uint64_t counter_ = 0;
};

PlaneTexture draw_texture(std::size_t texture_count, Draws& draws) {
  return {.image = draws.below(texture_count),
          .x_place = draws.uniform(0, 1),
          .y_place = draws.uniform(0, 1),
          .pixel_ratio = draws.log_uniform(0.3, 1.8),
          .flip_x = draws.chance(0.5),
          .flip_y = draws.chance(0.5),
          .inverted = draws.chance(0.15),
          .exponent = draws.uniform(1.1, 2.2),
          .mean_intensity = draws.log_uniform(0.18, 0.5)};
}

/// A motion by `shift_px` of what lies within `radius_px` of its centre.
PlaneMotion draw_motion(PlanePoint centre, double radius_px, double shift_px, Draws& draws) {
  // Each of turning and growing moves a point at the radius by less than the whole moves.
  const double turn = std::min(shift_px * draws.uniform(0, 0.7) / radius_px, 0.3);
  const double rotation = draws.uniform(-turn, turn);
  const double zoom = draws.uniform(-turn, turn);
  const double stretch = draws.uniform(-turn, turn) / 3;
  const double shear = draws.uniform(-turn, turn) / 3;
  // On what is small and moves far, the denominator stays above 1/2.
  const double tilt =
      std::min(std::min(0.1 * shift_px / radius_px, 0.1) / radius_px, 0.5 / (radius_px + shift_px));
  return {.centre = centre,
          .shift_px = draws.direction(shift_px),
          .linear = {zoom + stretch, shear - rotation, shear + rotation, zoom - stretch},
          .perspective_per_px = draws.direction(draws.uniform(0, tilt)),
          .acceleration = draws.chance(0.5) ? draws.uniform(-0.5, 0.5) : 0};
}

/// An ellipse, a box, or a polygon with notches, about the origin, `radius` being its longest.
std::vector<PlanePoint> draw_shape(double radius, Draws& draws) {
  const int kind = draws.between(0, 2);
  const double flatness = draws.log_uniform(kind == 1 ? 0.12 : 0.4, 1);
  std::vector<PlanePoint> outline;
  if (kind == 1) {
    const PlanePoint corner{radius * std::sqrt(1 / (1 + flatness * flatness)),
                            radius * std::sqrt(1 - 1 / (1 + flatness * flatness))};
    outline = {
        {corner.x, corner.y}, {-corner.x, corner.y}, {-corner.x, -corner.y}, {corner.x, -corner.y}};
  } else {
    const int corners = kind == 0 ? 32 : draws.between(3, 9);
    for (int i = 0; i < corners; ++i) {
      const double angle = 2 * std::numbers::pi * i / corners;
      const double reach = kind == 0 ? radius : radius * draws.uniform(0.4, 1);
      outline.push_back({reach * std::cos(angle), flatness * reach * std::sin(angle)});
    }
  }
  const PlanePoint turn = draws.direction(1);
  for (PlanePoint& corner : outline) {
    corner = {turn.x * corner.x - turn.y * corner.y, turn.y * corner.x + turn.x * corner.y};
  }
  return outline;
}

double draw_shift_px(Draws& draws) { return draws.log_uniform(0.3, 25); }

Plane draw_background(std::size_t texture_count, ImageSize size, double shift_px, Draws& draws) {
  const PlanePoint centre{0.5 * (size.width - 1), 0.5 * (size.height - 1)};
  const double radius = std::max(0.5 * std::max(size.height, size.width), 1.0);
  return {.texture = draw_texture(texture_count, draws),
          .motion = draw_motion(centre, radius, shift_px, draws),
          .outline = {},
          .softness_px = 0};
}

Plane draw_foreground(std::size_t texture_count, ImageSize size, double shift_px, Draws& draws) {
  const PlanePoint centre{draws.uniform(0, size.width), draws.uniform(0, size.height)};
  const double radius =
      std::max(draws.log_uniform(0.06, 0.4) * std::min(size.height, size.width), 1.5);
  Plane plane{.texture = draw_texture(texture_count, draws),
              .motion = draw_motion(centre, radius, shift_px, draws),
              .outline = draw_shape(radius, draws),
              .softness_px = draws.chance(0.3) ? draws.uniform(0.3, 2.5) : 0};
  for (PlanePoint& corner : plane.outline) {
    corner = {corner.x + centre.x, corner.y + centre.y};
  }
  return plane;
}

SensorSpec draw_sensor(Draws& draws) {
  const double threshold = draws.log_uniform(0.15, 0.8);
  const double asymmetry = std::sqrt(draws.log_uniform(0.5, 2));
  SensorSpec sensor;
  sensor.positive_threshold = threshold * asymmetry;
  sensor.negative_threshold = threshold / asymmetry;
  sensor.threshold_spread = threshold * draws.uniform(0, 0.15);
  sensor.refractory_s = draws.uniform(0, 1e-3);
  sensor.leak_rate_hz = draws.uniform(0, 0.2);
  sensor.shot_noise_rate_hz = draws.chance(0.5) ? draws.log_uniform(0.02, 1.5) : 0;
  if (draws.chance(0.1)) {
    sensor.hot_pixel_fraction = draws.log_uniform(1e-4, 3e-3);
    sensor.hot_pixel_rate_hz = draws.log_uniform(10, 300);
  }
  sensor.log_epsilon = draws.log_uniform(0.001, 0.02);
  return sensor;
}

}  // namespace

PlaneScene draw_plane_scene(std::size_t texture_count, ImageSize size, CounterRandom random) {
  if (texture_count == 0 || size.height < 1 || size.width < 1) {
    throw std::invalid_argument("expected textures and a size, got " +
                                std::to_string(texture_count) + " textures, " + to_string(size));
  }
  PlaneScene scene;
  scene.size = size;
  Draws draws(random.keyed("scene"));
  scene.duration_s = draws.log_uniform(0.005, 0.2);
  const bool is_static = draws.chance(0.05);
  const bool camera_rests = is_static || draws.chance(0.3);
  if (!is_static && draws.chance(0.1)) scene.light_change = draws.uniform(-0.3, 0.3);
  const int foregrounds = draws.between(camera_rests ? 1 : 0, 4);
  scene.optics_blur_px = draws.uniform(0.2, 1.4);

  Draws planes(random.keyed("planes"));
  scene.planes.push_back(
      draw_background(texture_count, size, camera_rests ? 0 : draw_shift_px(planes), planes));
  for (int i = 0; i < foregrounds; ++i) {
    scene.planes.push_back(
        draw_foreground(texture_count, size, is_static ? 0 : draw_shift_px(planes), planes));
  }

  Draws camera(random.keyed("camera"));
  scene.sensor = draw_sensor(camera);
  scene.cutoff_hz = camera.chance(0.5) ? camera.log_uniform(30, 3000) : 0;
  scene.level_spread = 1;
  scene.exposure = camera.chance(0.5) ? camera.uniform(0.05, 0.6) : 0;
  scene.gamma = camera.uniform(0.45, 1.1);
  // As an automatic exposure sets it, within limits: the background's mean is some grey.
  const double grey = camera.uniform(0.06, 0.65);
  const double background = scene.planes.front().texture.mean_intensity;
  scene.gain = std::clamp(grey / std::pow(background, scene.gamma), 0.3, 1.6);
  scene.read_noise_levels = camera.uniform(0, 2);
  return scene;
}

}  // namespace eventgan
