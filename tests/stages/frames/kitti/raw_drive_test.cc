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

/// Frames 0, 2 and 4.
class RawDriveTest : public ::testing::Test {
 protected:
  RawDriveTest() {
    for (const char* name : {"0000000000.png", "0000000002.png", "0000000004.png"}) {
      write_file(folder_ / ("raw/" + std::string(kFolder) + "/image_02/data/" + name), "");
    }
  }

  void write_timestamps(const std::string& text) {
    write_file(folder_ / ("raw/" + std::string(kFolder) + "/image_02/timestamps.txt"), text);
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
  write_timestamps(
      "2011-09-26 13:02:25\n2011-09-26 13:02:26\n2011-09-26 13:02:28\n2011-09-26 13:02:29\n"
      "2011-09-26 13:02:31\n");
  const RawDrive drive = open();
  EXPECT_EQ(drive.timestamps_path(),
            "raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/timestamps.txt");
  EXPECT_EQ(drive.fault(), "");
  EXPECT_EQ(drive.frame(2).frame.time_s, 3);
  EXPECT_EQ(drive.frame(4).frame.time_s, 6);
  EXPECT_TRUE(std::isnan(drive.time_s(5)));  // past the last line
  EXPECT_TRUE(std::isnan(drive.time_s(-1)));
}

TEST_F(RawDriveTest, DamagedTimestampsAreAFaultOfTheDriveAndItsTimesUnknown) {
  const std::string place =
      ", in raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/timestamps.txt";
  const std::string four =
      "2011-09-26 13:02:25\n2011-09-26 13:02:26\n2011-09-26 13:02:28\n2011-09-26 13:02:29\n";
  const std::pair<std::string, std::string> damaged[] = {
      {four, "expected a line for each frame up to 4, got 4 lines" + place},
      {"", "expected a line for each frame up to 4, got 0 lines" + place},
      {four + "2011-09-26 13:02:20\n",
       "expected a time after '2011-09-26 13:02:29', got '2011-09-26 13:02:20'" + place + ":5"},
      {four + "soon\n",
       "expected a time such as 2011-09-26 13:02:25.594360375, got 'soon'" + place + ":5"}};
  for (const auto& [text, fault] : damaged) {
    write_timestamps(text);
    const RawDrive drive = open();
    EXPECT_EQ(drive.fault(), fault);
    EXPECT_EQ(drive.frame(2).state, State::kPresent);
    EXPECT_TRUE(std::isnan(drive.frame(2).frame.time_s));
  }
}

TEST_F(RawDriveTest, AnAbsentDriveHasNoFrames) {
  const RawDrive drive(SourceRoot("raw", folder_.path()), "2011_09_26/none");
  EXPECT_TRUE(drive.pictures().empty());
  EXPECT_EQ(drive.frame(0).state, State::kBeyond);
}

}  // namespace
}  // namespace eventgan
