#include "stages/scenes/road/road_traffic.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace eventgan {
namespace {

std::map<int, Vehicle> by_number(std::uint64_t seed, int frame) {
  std::map<int, Vehicle> found;
  for (const Vehicle& vehicle : traffic(seed, frame)) found[vehicle.number] = vehicle;
  return found;
}

TEST(RoadTraffic, ParkedVehiclesComeNearerAtTheCamerasSpeed) {
  const auto before = by_number(7, 10);
  const auto after = by_number(7, 11);
  int parked = 0;
  for (const auto& [number, vehicle] : before) {
    if (std::abs(vehicle.location.x) < 6 || !after.contains(number)) continue;
    ++parked;
    EXPECT_NEAR(vehicle.location.z - after.at(number).location.z, kCameraSpeed * kFrameSeconds,
                1e-9);
  }
  EXPECT_GE(parked, 4);
}

TEST(RoadTraffic, OncomingOnesAreFasterAndTheOneAheadKeepsItsDistance) {
  const auto before = by_number(7, 10);
  const auto after = by_number(7, 11);
  EXPECT_LT(std::abs(before.at(0).location.z - after.at(0).location.z), 0.2);
  EXPECT_GT(before.at(2).location.z - after.at(2).location.z, 1.0);
}

TEST(RoadTraffic, LooksStayTheSameAndDependOnTheSeed) {
  const Vehicle early = by_number(7, 0).at(0);
  const Vehicle late = by_number(7, 30).at(0);
  EXPECT_EQ(early.type, late.type);
  EXPECT_EQ(early.length, late.length);
  EXPECT_NE(early.length, by_number(8, 0).at(0).length);
}

TEST(RoadTraffic, EveryVehicleStandsOnTheRoad) {
  for (const Vehicle& vehicle : traffic(1, 5)) {
    EXPECT_EQ(vehicle.location.y, kCameraHeight);
    EXPECT_GT(vehicle.height, 1.3);
    EXPECT_TRUE(vehicle.type == "Car" || vehicle.type == "Van");
  }
}

}  // namespace
}  // namespace eventgan
