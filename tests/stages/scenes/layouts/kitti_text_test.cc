#include "stages/scenes/layouts/kitti_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>

namespace eventgan {
namespace {

RoadLabel example() {
  RoadLabel label;
  label.vehicle.type = "Van";
  label.vehicle.height = 2.1;
  label.vehicle.width = 1.85;
  label.vehicle.length = 4.9;
  label.vehicle.location = {-3.456, 1.65, 20};
  label.vehicle.rotation_y = 1.57;
  label.box = {1.234, 2, 300.5, 188};
  label.truncation = 0.25;
  label.occlusion = 2;
  label.alpha = -1.4;
  return label;
}

TEST(KittiText, ALineInTheDevkitsOrder) {
  EXPECT_EQ(kitti_labels({example()}),
            "Van 0.25 2 -1.40 1.23 2.00 300.50 188.00 2.10 1.85 4.90 -3.46 1.65 20.00 1.57\n");
}

TEST(KittiText, FarVehiclesAreMarkedButNotDescribed) {
  RoadLabel far = example();
  far.dont_care = true;
  EXPECT_EQ(kitti_labels({far}),
            "DontCare -1 -1 -10 1.23 2.00 300.50 188.00 -1 -1 -1 -1000 -1000 -1000 -10\n");
}

TEST(KittiText, NoVehiclesNoLines) { EXPECT_EQ(kitti_labels({}), ""); }

TEST(KittiText, CalibrationHoldsTheCameraAsAMatrix) {
  std::istringstream lines(kitti_calibration({360, 361, 305, 88}));
  std::string line;
  for (int i = 0; i < 3; ++i) std::getline(lines, line);
  std::istringstream words(line);
  std::string name;
  words >> name;
  EXPECT_EQ(name, "P2:");
  std::vector<double> matrix;
  for (double value; words >> value;) matrix.push_back(value);
  EXPECT_THAT(matrix, ::testing::ElementsAre(360, 0, 305, 0, 0, 361, 88, 0, 0, 0, 1, 0));
}

}  // namespace
}  // namespace eventgan
