#include "stages/frames/kitti/kitti_raw_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
#include "tests/stages/frames/kitti/raw_fixture.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::pose_xml;
using ::testing::SizeIs;
using testing::tracklet_xml;
using testing::write_file;

using State = PairedFrame::State;

const std::string kFirst = "2011_09_26/2011_09_26_drive_0001_sync";
const std::string kSecond = "2011_09_28/2011_09_28_drive_0002_sync";

/// Two drives of two days with frames 0..2.
class KittiRawDatasetTest : public ::testing::Test {
 protected:
  KittiRawDatasetTest() {
    for (const std::string& drive : {kSecond, kFirst}) {
      for (const char* number : {"0", "1", "2"}) {
        write(drive + "/image_02/data/000000000" + number + ".png");
      }
    }
    spec_.root = "raw";
  }

  void write(const std::string& path, const std::string& text = "") {
    write_file(folder_ / ("raw/" + path), text);
  }

  /// A car before the camera in frame 1 of the first drive, another behind it in frames 1 and 2.
  void write_tracklets() {
    write(kFirst + "/tracklet_labels.xml",
          testing::tracklets_xml(tracklet_xml("Car", "1", pose_xml("12")) +
                                 tracklet_xml("Van", "1", pose_xml("-12") + pose_xml("-12"))));
  }

  void write_calibration() {
    write("2011_09_26/calib_velo_to_cam.txt", testing::kVeloToCam);
    write("2011_09_26/calib_cam_to_cam.txt", testing::kCamToCam);
  }

  std::unique_ptr<Dataset> open() const { return open_kitti_raw_dataset(spec_, folder_.path()); }

  const testing::TemporaryFolder folder_;
  SourceSpec spec_;
};

Annotation annotation_of(const Dataset& dataset, std::size_t frame) {
  return *dataset.annotation(dataset.labelled_frames().at(frame).label_key);
}

TEST_F(KittiRawDatasetTest, EveryImageIsALabelledFrame) {
  const auto dataset = open();
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(6));
  const LabelledFrame& frame = dataset->labelled_frames()[4];
  EXPECT_EQ(frame.sample_id, "2011_09_28_drive_0002_sync/0000000001");
  EXPECT_EQ(frame.sequence, "2011_09_28_drive_0002_sync");
  EXPECT_EQ(frame.frame.path, "raw/" + kSecond + "/image_02/data/0000000001.png");
  EXPECT_EQ(frame.frame.index, 1);
  EXPECT_DOUBLE_EQ(frame.frame.time_s, 0.1);
  EXPECT_EQ(frame.label_key, kSecond + "#1");
  EXPECT_THAT(dataset->notes(), IsEmpty());
  EXPECT_THAT(dataset->annotation_files(), IsEmpty());
}

TEST_F(KittiRawDatasetTest, PairedFramesStayInTheDrive) {
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[2];
  EXPECT_EQ(dataset->paired_frame(frame, -2).frame.path,
            "raw/" + kFirst + "/image_02/data/0000000000.png");
  EXPECT_EQ(dataset->paired_frame(frame, 0).frame, frame.frame);
  EXPECT_EQ(dataset->paired_frame(frame, 1).state, State::kBeyond);
}

TEST_F(KittiRawDatasetTest, WithoutTrackletsAnnotationsAreEmpty) {
  EXPECT_EQ(annotation_of(*open(), 0), Annotation());
}

TEST_F(KittiRawDatasetTest, TrackletsBecomeBoxesThroughTheCalibration) {
  write_tracklets();
  write_calibration();
  write(kSecond + "/image_02/timestamps.txt",
        "2011-09-28 13:00:00\n2011-09-28 13:00:01\n2011-09-28 13:00:02\n");
  const auto dataset = open();
  EXPECT_EQ(annotation_of(*dataset, 0).original, "[]");
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[1].label_key),
            "raw/" + kFirst + "/tracklet_labels.xml#1");
  const Annotation seen = annotation_of(*dataset, 1);
  ASSERT_THAT(seen.boxes, SizeIs(1));  // the van is behind the camera
  // The rear is 10 m away, 1 m wide and from 1 m below to 1 m above: see raw_fixture.h.
  EXPECT_EQ(seen.boxes[0].xyxy, (Rectangle{45, 10, 55, 30}));
  EXPECT_THAT(seen.original, HasSubstr("\"Car\""));
  EXPECT_THAT(seen.original, HasSubstr("\"Van\""));
  EXPECT_THAT(annotation_of(*dataset, 2).boxes, IsEmpty());
  EXPECT_THAT(
      dataset->annotation_files(),
      ElementsAre("raw/" + kFirst + "/tracklet_labels.xml", "raw/2011_09_26/calib_cam_to_cam.txt",
                  "raw/2011_09_26/calib_velo_to_cam.txt",
                  "raw/" + kSecond + "/image_02/timestamps.txt"));
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(KittiRawDatasetTest, WithoutCalibrationThereAreNoBoxesAndANoteSaysSo) {
  write_tracklets();
  const auto dataset = open();
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, IsEmpty());
  EXPECT_THAT(annotation_of(*dataset, 1).original, HasSubstr("\"Car\""));
  ASSERT_THAT(dataset->notes(), SizeIs(1));
  EXPECT_THAT(dataset->notes()[0], HasSubstr("no boxes from the tracklets of 1 drives"));
}

TEST_F(KittiRawDatasetTest, TrackletsBeyondTheImagesAreNoted) {
  write(kFirst + "/tracklet_labels.xml",
        testing::tracklets_xml(tracklet_xml("Car", "2", pose_xml("12") + pose_xml("12"))));
  write_calibration();
  const auto dataset = open();
  EXPECT_THAT(dataset->labelled_frames(), SizeIs(6));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 frame beyond the drive's images left out in raw/" +
                                            kFirst + "/tracklet_labels.xml"));
}

TEST_F(KittiRawDatasetTest, ATrackletsFrameWithoutImageInsideADriveIsMissing) {
  write_tracklets();  // frames 1 and 2
  write_calibration();
  write(kFirst + "/image_02/data/0000000003.png");
  std::filesystem::remove(folder_ / ("raw/" + kFirst + "/image_02/data/0000000002.png"));
  std::filesystem::remove(folder_ / ("raw/" + kSecond + "/image_02/data/0000000001.png"));
  const auto dataset = open();
  // Of the second drive's missing frame nothing is labelled.
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(4 + 2));
  const LabelledFrame& lost = dataset->labelled_frames()[2];
  EXPECT_EQ(lost.sample_id, "2011_09_26_drive_0001_sync/0000000002");
  EXPECT_EQ(lost.label_key, kFirst + "#2");
  EXPECT_EQ(dataset->paired_frame(lost, 0).state, State::kMissing);
  EXPECT_EQ(dataset->paired_frame(lost, 0).frame.path,
            "raw/" + kFirst + "/image_02/data/0000000002.png");
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(KittiRawDatasetTest, DamagedTimestampsAreAFaultOfTheirDrivesFrames) {
  write(kFirst + "/image_02/timestamps.txt",
        "2011-09-26 13:00:01\n2011-09-26 13:00:00\n2011-09-26 13:00:02\n");
  const auto dataset = open();
  const std::string fault =
      "expected a time after '2011-09-26 13:00:01', got '2011-09-26 13:00:00', in raw/" + kFirst +
      "/image_02/timestamps.txt:2";
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(6));
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(dataset->labelled_frames()[i].fault, i < 3 ? fault : "") << i;
  }
  EXPECT_THAT(dataset->notes(),
              ElementsAre("no frame of 2011_09_26_drive_0001_sync can be used: " + fault));
}

TEST_F(KittiRawDatasetTest, FilesAndFoldersLeftOutAreCountedAndNamed) {
  write(kFirst + "/image_02/data/left.png");
  write(kFirst + "/image_02/data/0000000001.jpg");
  write("2011_09_26/2011_09_26_drive_0001_extract/image_02/data/0.png");
  write("devkit/readme.txt");
  const auto dataset = open();
  EXPECT_THAT(dataset->labelled_frames(), SizeIs(6));
  EXPECT_THAT(
      dataset->notes(),
      ElementsAre("1 folder without a drive's name left out in raw/2011_09_26: "
                  "2011_09_26_drive_0001_extract",
                  "2 files left out in raw/" + kFirst + "/image_02/data: 0000000001.jpg, left.png",
                  "1 folder without a date's name left out in raw: devkit"));
}

TEST_F(KittiRawDatasetTest, AMalformedTrackletIsAFaultOfItsFrame) {
  write(kFirst + "/tracklet_labels.xml",
        testing::tracklets_xml(tracklet_xml("Car", "1", pose_xml("x"))));
  const auto outcome = open()->annotation(kFirst + "#1");
  ASSERT_TRUE(is_fault(outcome));
  EXPECT_THAT(outcome.fault().reason,
              HasSubstr("in raw/" + kFirst + "/tracklet_labels.xml (tracklet 0)"));
}

TEST_F(KittiRawDatasetTest, AKeyOfAnotherFormIsAFault) {
  const auto dataset = open();
  for (const std::string& key :
       {std::string(), kFirst, kFirst + "#", kFirst + "#x", std::string("a/b#1")}) {
    EXPECT_TRUE(is_fault(dataset->annotation(key))) << key;
  }
}

TEST_F(KittiRawDatasetTest, NeedsDrives) {
  spec_.root = "elsewhere";
  EXPECT_THROW(open(), InputError);
  write_file(folder_ / "elsewhere/2011_09_26/2011_09_26_drive_0001_extract/image_02/data/0.png",
             "");
  EXPECT_THROW(open(), InputError);
}

TEST(KittiRawData, RealDriveHasTwentyOneFrames) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  SourceSpec spec;
  spec.root = "kitti_raw";
  const auto dataset = open_kitti_raw_dataset(spec, data);
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(21));
  EXPECT_EQ(dataset->labelled_frames()[7].sample_id, "2011_09_26_drive_0052_sync/0000000007");
  EXPECT_EQ(dataset->paired_frame(dataset->labelled_frames()[7], -6).frame.index, 1);
}

TEST_F(KittiRawDatasetTest, UnreadableTrackletsAreAFaultOfTheirDriveAloneAndNotNone) {
  std::filesystem::create_symlink("tracklet_labels.xml",
                                  folder_ / ("raw/" + kFirst + "/tracklet_labels.xml"));
  const auto dataset = open();
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    EXPECT_EQ(is_fault(dataset->annotation(frame.label_key)), frame.label_key.starts_with(kFirst))
        << frame.sample_id;
  }
  EXPECT_THAT(dataset->annotation(kFirst + "#1").fault().reason,
              HasSubstr("'Too many levels of symbolic links', in raw/" + kFirst));
}

}  // namespace
}  // namespace eventgan
