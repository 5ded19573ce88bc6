#include "stages/frames/kitti/kitti_raw_dataset.h"

#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/kitti/raw_fixture.h"

namespace eventgan {
namespace {

using testing::pose_xml;
using testing::tracklet_xml;

const std::string kFirstDrive = "2011_09_26/2011_09_26_drive_0001_sync";
const std::string kSecond = "2011_09_28/2011_09_28_drive_0002_sync";

/// Two drives of two days with frames 0..2.
class KittiRawDatasetTest : public FolderTest {
 protected:
  KittiRawDatasetTest() {
    for (const std::string& drive : {kSecond, kFirstDrive}) {
      for (const int number : {0, 1, 2}) add(image(drive, number));
    }
    spec_.root = "raw";
  }

  static std::string image(const std::string& drive, int number) {
    return drive + "/image_02/data/000000000" + std::to_string(number) + ".png";
  }
  void add(const std::string& path, const std::string& text = "") const {
    write("raw/" + path, text);
  }
  void add_tracklets(const std::string& tracklets) const {
    add(kFirstDrive + "/tracklet_labels.xml", testing::tracklets_xml(tracklets));
  }

  /// A car before the camera in frame 1 of the first drive, another behind it in frames 1 and 2.
  void add_car_and_van() const {
    add_tracklets(tracklet_xml("Car", "1", pose_xml("12")) +
                  tracklet_xml("Van", "1", pose_xml("-12") + pose_xml("-12")));
  }

  void add_calibration() const {
    add("2011_09_26/calib_velo_to_cam.txt", testing::kVeloToCam);
    add("2011_09_26/calib_cam_to_cam.txt", testing::kCamToCam);
  }

  std::unique_ptr<Dataset> open() const { return open_kitti_raw_dataset(spec_, folder_.path()); }

  SourceSpec spec_;
};

TEST_F(KittiRawDatasetTest, EveryImageIsALabelledFrame) {
  const auto dataset = open();
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(6));
  const LabelledFrame& frame = dataset->labelled_frames()[4];
  EXPECT_EQ(text_of(frame),
            "2011_09_28_drive_0002_sync/0000000001 of 2011_09_28_drive_0002_sync: raw/" +
                image(kSecond, 1) + " 1 by " + kSecond + "#1");
  EXPECT_DOUBLE_EQ(frame.frame.time_s, 0.1);
  EXPECT_THAT(dataset->notes(), IsEmpty());
  EXPECT_THAT(dataset->annotation_files(), IsEmpty());
}

TEST_F(KittiRawDatasetTest, PairedFramesStayInTheDrive) {
  EXPECT_THAT(paired(*open(), 2, {-2, 0, 1}),
              ElementsAre("present raw/" + image(kFirstDrive, 0) + " 0",
                          "present raw/" + image(kFirstDrive, 2) + " 2", "beyond"));
}

TEST_F(KittiRawDatasetTest, WithoutTrackletsAnnotationsAreEmpty) {
  EXPECT_EQ(annotation_of(*open(), 0), Annotation());
}

TEST_F(KittiRawDatasetTest, TrackletsBecomeBoxesThroughTheCalibration) {
  add_car_and_van();
  add_calibration();
  add(kSecond + "/image_02/timestamps.txt",
      "2011-09-28 13:00:00\n2011-09-28 13:00:01\n2011-09-28 13:00:02\n");
  const auto dataset = open();
  EXPECT_EQ(annotation_of(*dataset, 0).original, "[]");
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[1].label_key),
            "raw/" + kFirstDrive + "/tracklet_labels.xml#1");
  const Annotation seen = annotation_of(*dataset, 1);
  // The rear is 10 m away, 1 m wide and from 1 m below to 1 m above: see raw_fixture.h. The van is
  // behind the camera.
  EXPECT_THAT(rectangles(seen), ElementsAre(Rectangle{45, 10, 55, 30}));
  EXPECT_THAT(seen.original, AllOf(HasSubstr("\"Car\""), HasSubstr("\"Van\"")));
  EXPECT_THAT(annotation_of(*dataset, 2).boxes, IsEmpty());
  EXPECT_THAT(
      dataset->annotation_files(),
      ElementsAre("raw/" + kFirstDrive + "/tracklet_labels.xml",
                  "raw/2011_09_26/calib_cam_to_cam.txt", "raw/2011_09_26/calib_velo_to_cam.txt",
                  "raw/" + kSecond + "/image_02/timestamps.txt"));
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(KittiRawDatasetTest, WithoutCalibrationThereAreNoBoxesAndANoteSaysSo) {
  add_car_and_van();
  const auto dataset = open();
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, IsEmpty());
  EXPECT_THAT(annotation_of(*dataset, 1).original, HasSubstr("\"Car\""));
  EXPECT_THAT(dataset->notes(), ElementsAre(HasSubstr("no boxes from the tracklets of 1 drives")));
}

TEST_F(KittiRawDatasetTest, TrackletsBeyondTheImagesAreNoted) {
  add_tracklets(tracklet_xml("Car", "2", pose_xml("12") + pose_xml("12")));
  add_calibration();
  const auto dataset = open();
  EXPECT_THAT(dataset->labelled_frames(), SizeIs(6));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 frame beyond the drive's images left out in raw/" +
                                            kFirstDrive + "/tracklet_labels.xml"));
}

TEST_F(KittiRawDatasetTest, ATrackletsFrameWithoutImageInsideADriveIsMissing) {
  add_car_and_van();  // frames 1 and 2
  add_calibration();
  add(image(kFirstDrive, 3));
  fs::remove(at("raw/" + image(kFirstDrive, 2)));
  fs::remove(at("raw/" + image(kSecond, 1)));
  const auto dataset = open();
  // Of the second drive's missing frame nothing is labelled.
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(4 + 2));
  EXPECT_EQ(dataset->labelled_frames()[2].sample_id, "2011_09_26_drive_0001_sync/0000000002");
  EXPECT_EQ(dataset->labelled_frames()[2].label_key, kFirstDrive + "#2");
  EXPECT_THAT(paired(*dataset, 2, {0}), ElementsAre("missing raw/" + image(kFirstDrive, 2) + " 2"));
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(KittiRawDatasetTest, DamagedTimestampsAreAFaultOfTheirDrivesFrames) {
  add(kFirstDrive + "/image_02/timestamps.txt",
      "2011-09-26 13:00:01\n2011-09-26 13:00:00\n2011-09-26 13:00:02\n");
  const auto dataset = open();
  const std::string fault =
      "expected a time after '2011-09-26 13:00:01', got '2011-09-26 13:00:00', in raw/" +
      kFirstDrive + "/image_02/timestamps.txt:2";
  EXPECT_THAT(faults_of(*dataset), ElementsAre(fault, fault, fault, "", "", ""));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("no frame of 2011_09_26_drive_0001_sync can be used: " + fault));
}

TEST_F(KittiRawDatasetTest, FilesAndFoldersLeftOutAreCountedAndNamed) {
  for (const std::string& path :
       {kFirstDrive + "/image_02/data/left.png", kFirstDrive + "/image_02/data/0000000001.jpg",
        "2011_09_26/2011_09_26_drive_0001_extract/image_02/data/0.png"s, "devkit/readme.txt"s}) {
    add(path);
  }
  const auto dataset = open();
  EXPECT_THAT(dataset->labelled_frames(), SizeIs(6));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 folder without a drive's name left out in raw/2011_09_26: "
                          "2011_09_26_drive_0001_extract",
                          "2 files left out in raw/" + kFirstDrive +
                              "/image_02/data: 0000000001.jpg, left.png",
                          "1 folder without a date's name left out in raw: devkit"));
}

TEST_F(KittiRawDatasetTest, AMalformedTrackletIsAFaultOfItsFrame) {
  add_tracklets(tracklet_xml("Car", "1", pose_xml("x")));
  EXPECT_THAT(fault_of(open()->annotation(kFirstDrive + "#1")),
              HasSubstr("in raw/" + kFirstDrive + "/tracklet_labels.xml (tracklet 0)"));
}

TEST_F(KittiRawDatasetTest, AKeyOfAnotherFormIsAFault) {
  const auto dataset = open();
  for (const std::string& key :
       {""s, kFirstDrive, kFirstDrive + "#", kFirstDrive + "#x", "a/b#1"s}) {
    EXPECT_THAT(fault_of(dataset->annotation(key)), HasSubstr("expected")) << key;
  }
}

TEST_F(KittiRawDatasetTest, NeedsDrives) {
  spec_.root = "elsewhere";
  EXPECT_THROWS(open(), InputError, "in elsewhere");
  write("elsewhere/2011_09_26/2011_09_26_drive_0001_extract/image_02/data/0.png");
  EXPECT_THROWS(open(), InputError, "DATE/DATE_drive_NNNN_sync", "in elsewhere");
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
  fs::create_symlink("tracklet_labels.xml",
                     folder_ / ("raw/" + kFirstDrive + "/tracklet_labels.xml"));
  const auto dataset = open();
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    EXPECT_EQ(is_fault(dataset->annotation(frame.label_key)),
              frame.label_key.starts_with(kFirstDrive))
        << frame.sample_id;
  }
  EXPECT_THAT(fault_of(dataset->annotation(kFirstDrive + "#1")),
              HasSubstr("'Too many levels of symbolic links', in raw/" + kFirstDrive));
}

}  // namespace
}  // namespace eventgan
