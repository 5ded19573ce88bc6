#include "stages/scenes/road/road_traffic.h"

#include <array>
#include <numbers>

#include "manifests/counter_random.h"

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
  Traffic(std::uint64_t seed, int frame)
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

std::vector<Vehicle> traffic(std::uint64_t seed, int frame) {
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

}  // namespace eventgan
