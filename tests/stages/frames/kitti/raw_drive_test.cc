#include "stages/frames/kitti/raw_drive.h"

#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

std::vector<double> parse(const std::string& text) {
  const auto outcome = parse_timestamps(text, "t.txt");
  if (is_fault(outcome)) ADD_FAILURE() << outcome.fault().reason;
  return is_fault(outcome) ? std::vector<double>() : *outcome;
}

std::string drive_fault(const std::string& text) {
  return fault_of(parse_timestamps(text, "t.txt"));
}

TEST(Timestamps, CountsFromTheFirstLine) {
  EXPECT_THAT(parse("2011-09-26 13:02:25.594360375\n"
                    "2011-09-26 13:02:25.694360380\r\n"
                    "2011-09-26 13:03:26.500000000"),
              ElementsAre(0, ::testing::DoubleEq(0.100000005),
                          ::testing::DoubleEq(60.905639625)));  // 61 s on, 0.594360375 - 0.5 back
}

TEST(Timestamps, RunsOnOverMidnightAndNewYear) {
  EXPECT_DOUBLE_EQ(parse("2011-12-31 23:59:59.9\n2012-01-01 00:00:00\n").at(1), 0.1);
}

TEST(Timestamps, ABlankLineIsAnUnknownTime) {
  EXPECT_THAT(parse("\n2011-09-26 13:02:25\n\n2011-09-26 13:02:26\n"),
              ElementsAre(::testing::IsNan(), 0, ::testing::IsNan(), 1));
}

TEST(Timestamps, AnEmptyFileHasNone) { EXPECT_TRUE(parse("").empty()); }

TEST(Timestamps, AnythingElseIsAFaultThatNamesTheLine) {
  for (const char* line :
       {"yesterday", "2011-09-26", "2011-09-26T13:02:25", "2011-13-26 13:02:25",
        "2011-02-30 13:02:25", "2011-09-26 24:02:25", "2011-09-26 13:02:25.x", "2011-09-26 13:02",
        "2011-09-26 13:02:-5", "26.09.2011 13:02:25", "2011-09-26 13:02:25 UTC",
        // Months and days that are September 26 in eight bits.
        "2011-265-282 13:02:26", "2011-265-26 13:02:26", "2011-09-282 13:02:26",
        "67547-09-26 13:02:26", "2011-9-26 13:02:26", "2011-09-26 13:02:2",
        "2011-09-26 13:02:26."}) {
    EXPECT_THAT(drive_fault(std::string("2011-09-26 13:02:25\n") + line + "\n"),
                AllOf(HasSubstr("expected a time such as "), HasSubstr("in t.txt:2")))
        << line;
  }
}

TEST(Timestamps, ATimeThatIsNotAfterTheOneBeforeIsAFault) {
  EXPECT_EQ(
      drive_fault("2011-09-26 13:02:25.6\n\n2011-09-26 13:02:25.5\n2011-09-26 13:02:26.0\n"),
      "expected a time after '2011-09-26 13:02:25.6', got '2011-09-26 13:02:25.5', in t.txt:3");
  EXPECT_THAT(drive_fault("2011-09-26 13:02:25.6\n2011-09-26 13:02:25.6\n"),
              HasSubstr("in t.txt:2"));
}

TEST(Timestamps, ALastLineThatIsCutShortIsAFault) {
  const std::string whole = "2011-09-26 13:02:25.594360375\n2011-09-26 13:02:26.694360380";
  EXPECT_EQ(parse(whole).size(), 2u);  // only the line end is missing
  for (std::size_t length = whole.size() - 1; length > whole.size() - 29; --length) {
    EXPECT_THAT(drive_fault(whole.substr(0, length)), HasSubstr("in t.txt:2")) << length;
  }
}

const std::string kDriveFolder = "2011_09_26/2011_09_26_drive_0052_sync";
const std::string kDriveData = "raw/" + kDriveFolder + "/image_02/data/000000000";

/// Frames 0, 2 and 4.
class RawDriveTest : public FolderTest {
 protected:
  RawDriveTest() { touch({kDriveData + "0.png", kDriveData + "2.png", kDriveData + "4.png"}); }

  void write_timestamps(const std::string& text) const {
    write("raw/" + kDriveFolder + "/image_02/timestamps.txt", text);
  }

  RawDrive open() const { return {SourceRoot("raw", folder_.path()), kDriveFolder}; }
};

TEST_F(RawDriveTest, FindsAFrameByItsNumber) {
  EXPECT_EQ(text_of(open().frame(2)), "present " + kDriveData + "2.png 2");
  EXPECT_EQ(open().frame(2).frame.video_frame, -1);
}

TEST_F(RawDriveTest, AStepIsOneFrameWhateverIsStored) {
  const RawDrive drive = open();
  EXPECT_EQ(text_of(drive.frame(3)), "missing " + kDriveData + "3.png 3");
  EXPECT_EQ(text_of(drive.frame(5)), "beyond");
  EXPECT_EQ(text_of(drive.frame(-1)), "beyond");
  EXPECT_EQ(text_of(drive.paired_frame(2, 1)), "missing " + kDriveData + "3.png 3");
  EXPECT_EQ(text_of(drive.paired_frame(2, -2)), "present " + kDriveData + "0.png 0");
  EXPECT_EQ(text_of(drive.paired_frame(2, 2)), "present " + kDriveData + "4.png 4");
  EXPECT_EQ(text_of(drive.paired_frame(2, 3)), "beyond");
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
  EXPECT_EQ(drive.timestamps_path(), "raw/" + kDriveFolder + "/image_02/timestamps.txt");
  EXPECT_EQ(drive.fault(), "");
  EXPECT_EQ(drive.frame(2).frame.time_s, 3);
  EXPECT_EQ(drive.frame(4).frame.time_s, 6);
  for (const int beyond : {5, -1}) EXPECT_TRUE(std::isnan(drive.time_s(beyond))) << beyond;
}

TEST_F(RawDriveTest, DamagedTimestampsAreAFaultOfTheDriveAndItsTimesUnknown) {
  const std::string place = ", in raw/" + kDriveFolder + "/image_02/timestamps.txt";
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
  EXPECT_TRUE(drive.images().empty());
  EXPECT_EQ(drive.frame(0).state, State::kBeyond);
}

constexpr const char* kMapping =
    "2011_09_26 2011_09_26_drive_0005_sync 0000000109\n"
    "2011_09_26 2011_09_26_drive_0052_sync 0000000007\r\n"
    "2011_09_28 2011_09_28_drive_0222_sync 0000000053";

RawMapping parse(std::string_view rand, std::string_view mapping) {
  return {rand, "rand.txt", mapping, "mapping.txt"};
}

TEST(RawMapping, LeadsThroughThePermutationCountedFromOne) {
  const RawMapping mapping = parse("2,3,1\n", kMapping);
  EXPECT_EQ(mapping.find(0), (RawFrame{"2011_09_26", "2011_09_26_drive_0052_sync", 7}));
  EXPECT_EQ(mapping.find(1), (RawFrame{"2011_09_28", "2011_09_28_drive_0222_sync", 53}));
  EXPECT_EQ(mapping.find(2), (RawFrame{"2011_09_26", "2011_09_26_drive_0005_sync", 109}));
}

TEST(RawMapping, KnowsNoOtherImages) {
  const RawMapping mapping = parse("2,3,1\n", kMapping);
  EXPECT_EQ(mapping.find(3), std::nullopt);
  EXPECT_EQ(mapping.find(-1), std::nullopt);
  EXPECT_EQ(parse("", "").find(0), std::nullopt);
}

TEST(RawMapping, AnythingElseIsAnErrorThatNamesTheFile) {
  const struct {
    std::string_view rand, mapping;
    const char *got, *where;
  } cases[] = {{"0", kMapping, "expected line numbers from 1 to 3, got '0'", "in rand.txt"},
               {"1,4", kMapping, "got '4'", "in rand.txt"},
               {"1,x", kMapping, "got 'x'", "in rand.txt"},
               {"1", "2011_09_26 drive\n", "expected DATE DRIVE FRAME", "mapping.txt:1"},
               {"1", "a b 1\n\na b 2\n", "got '?'", "mapping.txt:2"},
               {"1", "a b -1\n", "got 'a b -1?'", "mapping.txt:1"}};
  for (const auto& [rand, mapping, got, where] : cases) {
    EXPECT_THROWS(parse(rand, mapping), InputError, got, where);
  }
}

TEST(RawMapping, LeadsToTheFramesTheDevkitNames) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto folder = data / "kitti_object/devkit/mapping";
  const RawMapping mapping =
      parse(read_file(folder / "train_rand.txt"), read_file(folder / "train_mapping.txt"));
  const std::string drive = "2011_09_26_drive_0052_sync";
  EXPECT_EQ(mapping.find(1497), (RawFrame{"2011_09_26", drive, 7}));
  EXPECT_EQ(mapping.find(4587), (RawFrame{"2011_09_26", drive, 14}));
  EXPECT_TRUE(mapping.find(7480));
  EXPECT_FALSE(mapping.find(7481));
}

}  // namespace
}  // namespace eventgan
