#include "stages/scenes/road/road_surroundings.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stages/scenes/road/road_traffic.h"

namespace eventgan {
namespace {

constexpr double kWallDistance = 9.5;  // m to either side
constexpr double kHouseLength = 11;    // m along the street
constexpr Colour kHaze{225, 215, 205};

/// How much of a pattern with details of `detail` m is left where a pixel covers `footprint` m.
float visible_share(double detail, double footprint) {
  return static_cast<float>(std::clamp(1.5 - footprint / detail, 0.0, 1.0));
}

Colour through_haze(const Colour& colour, double z) {
  return mix(kHaze, colour, static_cast<float>(std::exp(-z / 90)));
}

/// Distance to the nearest multiple of `period`.
double off_grid(double value, double period) {
  return std::abs(value - period * std::round(value / period));
}

}  // namespace

RoadSurroundings::RoadSurroundings(std::uint64_t seed, double focal_px)
    : texture_(CounterRandom(seed).keyed("street")), focal_px_(focal_px) {}

Colour RoadSurroundings::ground(double x, double z, double travelled) const {
  const double along = z + travelled;
  // A pixel covers most along the line of sight: dz = z^2 / (f h).
  const double footprint = z * z / (focal_px_ * kCameraHeight);
  const float coarse =
      visible_share(1.2, footprint) * (texture_.noise(x / 0.9, along / 1.6) - 0.5f);
  const float fine = visible_share(0.3, footprint) * (texture_.noise(x / 0.2, along / 0.3) - 0.5f);
  if (std::abs(x) > 8) {
    const bool joint = off_grid(along, 1.2) < 0.05 || off_grid(x, 0.8) < 0.04;
    const float seam = joint ? 30 * visible_share(0.5, footprint) : 0;
    return Colour{150, 155, 160} + Colour{1, 1, 1} * (30 * coarse + 14 * fine - seam);
  }
  const bool lane = off_grid(std::abs(x) - 1.75, 100) < 0.08 && std::fmod(along + 3000, 6) < 2.5;
  const bool edge = std::abs(std::abs(x) - 5.4) < 0.08;
  if (lane || edge) return Colour{225, 230, 230} + Colour{1, 1, 1} * (20 * fine);
  return Colour{92, 90, 88} + Colour{1, 1, 1} * (46 * coarse + 22 * fine);
}

Colour RoadSurroundings::wall(double side, double y, double z, double travelled) const {
  const double along = z + travelled;
  const int house = static_cast<int>(std::floor(along / kHouseLength)) + (side > 0 ? 5000 : 0);
  const float tone = texture_.cell(house, -7);
  const Colour plaster = mix(Colour{120, 150, 190}, Colour{190, 195, 185}, tone);
  const double footprint = z * z / (focal_px_ * kWallDistance);
  const float grain = visible_share(0.8, footprint) * (texture_.noise(along / 0.7, y / 0.5) - 0.5f);

  const double column = std::fmod(along + 3000, 2.75) / 2.75;
  const double storey = std::fmod(y + 60, 2.6) / 2.6;
  const bool window = column > 0.3 && column < 0.7 && storey > 0.25 && storey < 0.75 && y < 0.3;
  if (window) {
    const float pane = texture_.cell(static_cast<int>(std::floor(along / 2.75)) * 7 + house,
                                     static_cast<int>(std::floor((y + 60) / 2.6)));
    const float contrast = visible_share(2.2, footprint);
    return mix(plaster * 0.8f, Colour{95, 80, 70} * (0.6f + 0.8f * pane), contrast);
  }
  return plaster + Colour{1, 1, 1} * (50 * grain);
}

Colour RoadSurroundings::sky(const Vector3& direction) const {
  const float height = static_cast<float>(std::clamp(-direction.y * 3.5, 0.0, 1.0));
  const float cloud = texture_.noise(direction.x * 5 + 40, direction.y * 14);
  const Colour blue = mix(kHaze, Colour{235, 180, 130}, height);
  return mix(blue, Colour{245, 245, 245}, 0.5f * cloud * cloud);
}

Background RoadSurroundings::look(const Vector3& direction, double travelled) const {
  const double to_wall = kWallDistance / std::max(std::abs(direction.x), 1e-9);
  const double to_ground =
      direction.y > 1e-9 ? kCameraHeight / direction.y : std::numeric_limits<double>::infinity();
  if (to_ground < to_wall && to_ground < 400) {
    const Colour colour = ground(direction.x * to_ground, to_ground, travelled);
    return {through_haze(colour, to_ground), to_ground, true};
  }
  const double side = direction.x > 0 ? 1 : -1;
  const int house =
      static_cast<int>(std::floor((to_wall + travelled) / kHouseLength)) + (side > 0 ? 5000 : 0);
  const double roof = -3.5 - 4.5 * texture_.cell(house, -3);
  const double y = direction.y * to_wall;
  if (to_wall < 400 && y > roof) {
    return {through_haze(wall(side, y, to_wall, travelled), to_wall), to_wall, false};
  }
  return {sky(direction), std::numeric_limits<double>::infinity(), false};
}

}  // namespace eventgan
