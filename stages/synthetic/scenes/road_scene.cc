#include "stages/synthetic/scenes/road_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "manifests/values/counter_random.h"
#include "stages/synthetic/scenes/camera.h"
#include "stages/synthetic/scenes/vehicle.h"

namespace eventgan {
namespace {

constexpr double kAway = -std::numbers::pi / 2;
constexpr double kTowards = std::numbers::pi / 2;

Colour paint_of(double choice) {
  static constexpr std::array<Colour, 7> kPaints{{{60, 60, 190},
                                                  {190, 110, 40},
                                                  {215, 215, 215},
                                                  {70, 140, 60},
                                                  {60, 170, 215},
                                                  {95, 90, 85},
                                                  {150, 70, 130}}};
  return kPaints[static_cast<std::size_t>(choice * kPaints.size())];
}

/// What distinguishes one vehicle from another.
struct Course {
  double x;        ///< m to the right of the camera
  double start_z;  ///< m ahead at frame 0
  double speed;    ///< m/s over ground, along z
  double rotation_y;
};

class Traffic {
 public:
  Traffic(std::uint64_t seed, double frame)
      : random_(CounterRandom(seed).keyed("traffic")), seconds_(frame * kFrameSeconds) {}

  /// Adds the next vehicle; its looks depend on its number alone.
  void add(const Course& course) {
    const auto counter = static_cast<std::uint64_t>(16 * number_);
    Vehicle vehicle;
    vehicle.number = number_++;
    const bool van = random_.uniform(counter) < 0.25;
    vehicle.type = van ? "Van" : "Car";
    vehicle.height = (van ? 2.0 : 1.45) + 0.15 * random_.uniform(counter + 1);
    vehicle.width = (van ? 1.8 : 1.6) + 0.15 * random_.uniform(counter + 2);
    vehicle.length = (van ? 4.8 : 3.7) + 0.7 * random_.uniform(counter + 3);
    vehicle.paint = paint_of(random_.uniform(counter + 4));
    vehicle.rotation_y = course.rotation_y + 0.06 * (random_.uniform(counter + 5) - 0.5);
    vehicle.location = {course.x + 0.3 * (random_.uniform(counter + 6) - 0.5), kCameraHeight,
                        course.start_z + 2 * random_.uniform(counter + 7) +
                            (course.speed - kCameraSpeed) * seconds_};
    if (vehicle.location.z > -vehicle.length && vehicle.location.z < 60) {
      vehicles_.push_back(vehicle);
    }
  }

  std::vector<Vehicle> take() { return std::move(vehicles_); }

 private:
  CounterRandom random_;
  double seconds_;
  int number_ = 0;
  std::vector<Vehicle> vehicles_;
};

}  // namespace

std::vector<Vehicle> traffic(std::uint64_t seed, double frame) {
  Traffic road(seed, frame);
  road.add({0.2, 15, kCameraSpeed + 0.8, kAway});
  road.add({3.5, 8, kCameraSpeed - 0.7, kAway});
  for (int i = 0; i < 3; ++i) road.add({-3.5, 30.0 + 28 * i, -7, kTowards});
  for (int i = 0; i < 8; ++i) {
    road.add({6.9, 10.0 + 13 * i, 0, kAway});
    road.add({-6.9, 16.0 + 13 * i, 0, kTowards});
  }
  return road.take();
}

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

namespace {

/// Samples a pixel and direction: an edge that moves by part of a pixel must show.
constexpr int kSamples = 2;

/// A vehicle, and the pixels on which it or its shade can be seen.
struct Candidate {
  VehicleShape shape;
  int number;
  Rectangle reach;
};

std::vector<Candidate> candidates_of(const std::vector<RoadLabel>& labels, double focal_px) {
  std::vector<Candidate> candidates;
  for (const RoadLabel& label : labels) {
    const double nearest = std::max(label.vehicle.location.z - label.vehicle.length, 0.5);
    const double margin = 2 + 2 * VehicleShape::kShade * focal_px / nearest;
    const Rectangle& box = label.outline;
    candidates.push_back(
        {VehicleShape(label.vehicle),
         label.vehicle.number,
         {box.left - margin, box.top - margin, box.right + margin, box.bottom + margin}});
  }
  return candidates;
}

bool reaches(const Candidate& candidate, int x, int y) {
  const Rectangle& reach = candidate.reach;
  return x >= reach.left && x <= reach.right && y >= reach.top && y <= reach.bottom;
}

class Tracer {
 public:
  Tracer(const RoadSurroundings& surroundings, double travelled)
      : surroundings_(surroundings), travelled_(travelled) {}

  void look_at(const std::vector<Candidate>& candidates, int x, int y) {
    nearby_.clear();
    for (const Candidate& candidate : candidates) {
      if (reaches(candidate, x, y)) nearby_.push_back(&candidate);
    }
  }

  int object(const Vector3& direction) const {
    const auto [hit, candidate] = nearest(direction);
    return candidate == nullptr ? -1 : candidate->number;
  }

  Colour colour(const Vector3& direction) const {
    const auto [hit, candidate] = nearest(direction);
    if (hit) return hit->colour;
    const Background background = surroundings_.look(direction, travelled_);
    if (!background.is_road) return background.colour;
    const Vector3 ground = direction * background.distance;
    const bool shaded = std::any_of(nearby_.begin(), nearby_.end(), [&](const Candidate* near) {
      return near->shape.shades(ground);
    });
    return shaded ? background.colour * 0.35f : background.colour;
  }

 private:
  std::pair<std::optional<VehicleHit>, const Candidate*> nearest(const Vector3& direction) const {
    std::pair<std::optional<VehicleHit>, const Candidate*> result{std::nullopt, nullptr};
    for (const Candidate* candidate : nearby_) {
      const auto hit = candidate->shape.hit(direction);
      if (hit && (!result.first || hit->distance < result.first->distance)) {
        result = {hit, candidate};
      }
    }
    return result;
  }

  const RoadSurroundings& surroundings_;
  double travelled_;
  std::vector<const Candidate*> nearby_;
};

}  // namespace

RoadScene::RoadScene(std::uint64_t seed) : seed_(seed), surroundings_(seed, camera().focal_x) {}

Image RoadScene::render(double frame) const {
  const Intrinsics eye = camera();
  const std::vector<Candidate> candidates = candidates_of(in_view(frame), eye.focal_x);
  Tracer tracer(surroundings_, frame * kFrameSeconds * kCameraSpeed);
  Image image = black_image(size());
  for (int y = 0; y < size().height; ++y) {
    for (int x = 0; x < size().width; ++x) {
      tracer.look_at(candidates, x, y);
      Colour sum;
      for (int sample = 0; sample < kSamples * kSamples; ++sample) {
        const double u = x + (sample % kSamples + 0.5) / kSamples - 0.5;
        const double v = y + (sample / kSamples + 0.5) / kSamples - 0.5;
        sum = sum + tracer.colour(ray(eye, u, v));
      }
      set_pixel(image, x, y, sum * (1.0f / (kSamples * kSamples)));
    }
  }
  return image;
}

std::vector<int> RoadScene::objects(double frame) const {
  const Intrinsics eye = camera();
  const std::vector<Candidate> candidates = candidates_of(in_view(frame), eye.focal_x);
  Tracer tracer(surroundings_, frame * kFrameSeconds * kCameraSpeed);
  std::vector<int> objects;
  for (int y = 0; y < size().height; ++y) {
    for (int x = 0; x < size().width; ++x) {
      tracer.look_at(candidates, x, y);
      objects.push_back(tracer.object(ray(eye, x, y)));
    }
  }
  return objects;
}

namespace {

double area(const Rectangle& box) {
  return std::max(0.0, box.right - box.left) * std::max(0.0, box.bottom - box.top);
}

Rectangle overlap(const Rectangle& a, const Rectangle& b) {
  return {std::max(a.left, b.left), std::max(a.top, b.top), std::min(a.right, b.right),
          std::min(a.bottom, b.bottom)};
}

double observation_angle(const Vehicle& vehicle) {
  const double angle = vehicle.rotation_y - std::atan2(vehicle.location.x, vehicle.location.z);
  return std::remainder(angle, 2 * std::numbers::pi);
}

/// True if a nearer outline covers the whole box: the vehicle behind it is as good as unseen.
bool is_hidden(const Rectangle& box, const std::vector<RoadLabel>& nearer) {
  return std::any_of(nearer.begin(), nearer.end(), [&](const RoadLabel& label) {
    return area(overlap(box, label.outline)) >= 0.99 * area(box);
  });
}

int occlusion_of(const Rectangle& box, const std::vector<RoadLabel>& nearer) {
  double covered = 0;
  for (const RoadLabel& label : nearer) covered += area(overlap(box, label.outline));
  const double share = covered / area(box);
  return share < 0.05 ? 0 : share < 0.5 ? 1 : 2;
}

}  // namespace

std::vector<RoadLabel> RoadScene::in_view(double frame) const {
  std::vector<Vehicle> vehicles = traffic(seed_, frame);
  std::sort(vehicles.begin(), vehicles.end(), [](const Vehicle& a, const Vehicle& b) {
    return a.location.z != b.location.z ? a.location.z < b.location.z : a.number < b.number;
  });
  std::vector<RoadLabel> seen;
  for (const Vehicle& vehicle : vehicles) {
    RoadLabel label;
    label.vehicle = vehicle;
    const VehicleShape shape(vehicle);
    label.outline = whole_outline(shape, camera());
    label.box = visible_outline(shape, camera(), size());
    if (area(label.box) <= 0) continue;
    label.truncation = std::clamp(1 - area(label.box) / area(label.outline), 0.0, 1.0);
    label.occlusion = occlusion_of(label.box, seen);
    label.alpha = observation_angle(vehicle);
    label.dont_care = vehicle.location.z > kDontCareDistance;
    seen.push_back(label);
  }
  return seen;
}

std::vector<RoadLabel> RoadScene::labels(double frame) const {
  std::vector<RoadLabel> labels;
  std::vector<RoadLabel> nearer;
  for (const RoadLabel& label : in_view(frame)) {
    const Rectangle& box = label.box;
    const bool large = box.right - box.left >= 2 && box.bottom - box.top >= 2;
    if (large && !is_hidden(box, nearer)) labels.push_back(label);
    nearer.push_back(label);
  }
  return labels;
}

}  // namespace eventgan
