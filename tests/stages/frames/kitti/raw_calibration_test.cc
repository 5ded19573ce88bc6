#include "stages/frames/kitti/raw_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/stages/frames/kitti/raw_fixture.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::kCamToCam;
using testing::kVeloToCam;
using testing::TemporaryFolder;
using testing::write_file;

std::optional<RawCalibration> read(const std::string& velo_to_cam, const std::string& cam_to_cam) {
  const TemporaryFolder folder;
  write_file(folder / "2011_09_26/calib_velo_to_cam.txt", velo_to_cam);
  write_file(folder / "2011_09_26/calib_cam_to_cam.txt", cam_to_cam);
  return read_raw_calibration(SourceRoot(".", folder.path()), "2011_09_26");
}

TEST(RawCalibration, TakesAPointThroughBothFrames) {
  const auto calibration = read("R: 0 -1 0 0 0 -1 1 0 0\nT: 0.5 0.25 -1\n",
                                "S_rect_02: 1242 375\n"
                                "R_rect_00: 0 1 0 -1 0 0 0 0 1\n"
                                "P_rect_02: 100 0 50 200 0 100 20 0 0 0 1 0\n");
  ASSERT_TRUE(calibration);
  EXPECT_EQ(calibration->picture, (ImageSize{375, 1242}));
  // R (5, 1, 2) + T = (-1, -2, 5) + (0.5, 0.25, -1) = (-0.5, -1.75, 4); then x = y, y = -x.
  EXPECT_THAT(calibration->to_rectified({5, 1, 2}), ElementsAre(-1.75, 0.5, 4));
  // u = (100 (-1.75) + 50 4 + 200) / 4, v = (100 0.5 + 20 4) / 4.
  EXPECT_EQ(calibration->project({-1.75, 0.5, 4}), (Point{56.25, 32.5}));
}

TEST(RawCalibration, NeedsBothFiles) {
  const TemporaryFolder folder;
  const SourceRoot root(".", folder.path());
  EXPECT_FALSE(read_raw_calibration(root, "2011_09_26"));
  write_file(folder / "2011_09_26/calib_velo_to_cam.txt", kVeloToCam);
  EXPECT_FALSE(read_raw_calibration(root, "2011_09_26"));
  write_file(folder / "2011_09_26/calib_cam_to_cam.txt", kCamToCam);
  EXPECT_TRUE(read_raw_calibration(root, "2011_09_26"));
}

void expect_error(const std::string& velo_to_cam, const std::string& cam_to_cam,
                  const std::string& message) {
  try {
    read(velo_to_cam, cam_to_cam);
    FAIL() << "no error: " << message;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr(message), HasSubstr("2011_09_26/calib_")));
  }
}

TEST(RawCalibration, AMalformedFileIsAnErrorThatNamesTheKey) {
  expect_error("R: 0 -1 0 0 0 -1 1 0 0\n", kCamToCam, "expected a line T, got none");
  expect_error("R: 1 2 3\nT: 0 0 0\n", kCamToCam, "expected 9 numbers for R, got 3");
  expect_error("R: 0 -1 0 0 0 -1 1 0 0\nT: 0 x 0\n", kCamToCam, "got 'x'");
  expect_error("R: 0 -1 0 0 0 -1 1 0 0\nT: 0 nan 0\n", kCamToCam, "got 'nan'");
  expect_error(kVeloToCam, "", "expected a line R_rect_00");
  expect_error(kVeloToCam,
               "S_rect_02: 0 40\nR_rect_00: 1 0 0 0 1 0 0 0 1\n"
               "P_rect_02: 100 0 50 0 0 100 20 0 0 0 1 0\n",
               "expected a picture size");
}

}  // namespace
}  // namespace eventgan
