#include "stages/scenes/road/road_scene.h"

#include <algorithm>
#include <optional>

#include "stages/scenes/camera.h"
#include "stages/scenes/road/road_traffic.h"
#include "stages/scenes/road/vehicle_shape.h"

namespace eventgan {
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

Picture RoadScene::picture(int frame) const {
  const Intrinsics eye = camera();
  const std::vector<Candidate> candidates = candidates_of(in_view(frame), eye.focal_x);
  Tracer tracer(surroundings_, frame * kFrameSeconds * kCameraSpeed);
  Picture picture = black_picture(size());
  for (int y = 0; y < size().height; ++y) {
    for (int x = 0; x < size().width; ++x) {
      tracer.look_at(candidates, x, y);
      Colour sum;
      for (int sample = 0; sample < kSamples * kSamples; ++sample) {
        const double u = x + (sample % kSamples + 0.5) / kSamples - 0.5;
        const double v = y + (sample / kSamples + 0.5) / kSamples - 0.5;
        sum = sum + tracer.colour(ray(eye, u, v));
      }
      set_pixel(picture, x, y, sum * (1.0f / (kSamples * kSamples)));
    }
  }
  return picture;
}

std::vector<int> RoadScene::objects(int frame) const {
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

}  // namespace eventgan
