#include "stages/frames/kitti/raw_drive.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using State = Neighbour::State;
using testing::TemporaryFolder;
using testing::write_file;

constexpr const char* kFolder = "2011_09_26/2011_09_26_drive_0052_sync";

/// Frames 0, 2 and 4, and times for 0..2.
class RawDriveTest : public ::testing::Test {
 protected:
  RawDriveTest() {
    for (const char* name : {"0000000000.png", "0000000002.png", "0000000004.png"}) {
      write_file(folder_ / ("raw/" + std::string(kFolder) + "/image_02/data/" + name), "");
    }
  }

  void write_timestamps() {
    write_file(folder_ / ("raw/" + std::string(kFolder) + "/image_02/timestamps.txt"),
               "2011-09-26 13:02:25\n2011-09-26 13:02:26\n2011-09-26 13:02:28\n");
  }

  RawDrive open() const { return {SourceRoot("raw", folder_.path()), kFolder}; }

  const TemporaryFolder folder_;
};

TEST_F(RawDriveTest, FindsAFrameByItsNumber) {
  const Neighbour frame = open().frame(2);
  EXPECT_EQ(frame.state, State::kPresent);
  EXPECT_EQ(frame.frame.path,
            "raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/data/0000000002.png");
  EXPECT_EQ(frame.frame.index, 2);
  EXPECT_EQ(frame.frame.video_frame, -1);
}

TEST_F(RawDriveTest, AStepIsOneFrameWhateverIsStored) {
  const RawDrive drive = open();
  EXPECT_EQ(drive.frame(3).state, State::kHole);
  EXPECT_EQ(drive.frame(3).frame.path,
            "raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/data/0000000003.png");
  EXPECT_EQ(drive.frame(5).state, State::kBeyond);
  EXPECT_EQ(drive.frame(-1).state, State::kBeyond);
  EXPECT_EQ(drive.neighbour(2, 1).state, State::kHole);
  EXPECT_EQ(drive.neighbour(2, 1).frame.index, 3);
  EXPECT_EQ(drive.neighbour(2, -2).frame.index, 0);
  EXPECT_EQ(drive.neighbour(2, 2).state, State::kPresent);
  EXPECT_EQ(drive.neighbour(2, 3).state, State::kBeyond);
}

TEST_F(RawDriveTest, TimesAreTenAStepWithoutTimestamps) {
  const RawDrive drive = open();
  EXPECT_EQ(drive.timestamps_path(), "");
  EXPECT_DOUBLE_EQ(drive.time_s(4), 0.4);
}

TEST_F(RawDriveTest, TimesComeFromTheTimestamps) {
  write_timestamps();
  const RawDrive drive = open();
  EXPECT_EQ(drive.timestamps_path(),
            "raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/timestamps.txt");
  EXPECT_EQ(drive.frame(2).frame.time_s, 3);
  EXPECT_TRUE(std::isnan(drive.frame(4).frame.time_s));  // past the last line
  EXPECT_TRUE(std::isnan(drive.time_s(-1)));
}

TEST_F(RawDriveTest, AnAbsentDriveHasNoFrames) {
  const RawDrive drive(SourceRoot("raw", folder_.path()), "2011_09_26/none");
  EXPECT_TRUE(drive.pictures().empty());
  EXPECT_EQ(drive.frame(0).state, State::kBeyond);
}

}  // namespace
}  // namespace eventgan
