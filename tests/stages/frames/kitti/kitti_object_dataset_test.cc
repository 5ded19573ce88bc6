#include "stages/frames/kitti/kitti_object_dataset.h"

#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

class ObjectImagesTest : public FolderTest {
 protected:
  std::string at_back(std::int64_t number, const std::string& name, int back) const {
    const auto place = ObjectImages(SourceRoot(".", folder_.path())).at(number, name, -back);
    if (place.state == State::kBeyond) return "beyond";
    return (place.state == State::kPresent ? "present " : "missing ") + place.path;
  }
};

TEST_F(ObjectImagesTest, FindsTheImageAndTheThreeBeforeIt) {
  touch({"image_2/001497.png", "prev_2/001497_01.png", "prev_2/001497_02.jpg",
         "prev_2/001497_03.webp", "prev_2/001498_01.png"});
  EXPECT_EQ(at_back(1497, "001497", 0), "present image_2/001497.png");
  EXPECT_EQ(at_back(1497, "001497", 1), "present prev_2/001497_01.png");
  EXPECT_EQ(at_back(1497, "001497", 2), "present prev_2/001497_02.jpg");
  EXPECT_EQ(at_back(1497, "001497", 3), "present prev_2/001497_03.webp");
}

TEST_F(ObjectImagesTest, AnAbsentPreviousFrameIsMissingIfOneFurtherBackIsThere) {
  touch({"image_2/000001.png", "prev_2/000001_02.png"});
  EXPECT_EQ(at_back(1, "000001", 1), "missing prev_2/000001_01.png");
  EXPECT_EQ(at_back(1, "000001", 2), "present prev_2/000001_02.png");
  EXPECT_EQ(at_back(1, "000001", 3), "beyond");
}

TEST_F(ObjectImagesTest, AnAbsentImageIsMissingEvenWithoutOthers) {
  write("image_2/000001.png");
  EXPECT_EQ(at_back(7, "000007", 0), "missing image_2/000007.png");
  EXPECT_EQ(at_back(7, "000007", 1), "beyond");
}

TEST_F(ObjectImagesTest, NeedsAFolderOfImages) {
  EXPECT_THROWS(at_back(1, "000001", 0), InputError, "expected a folder", "image_2");
}

constexpr const char* kLabel =
    "Car 0.00 0 1.85 387.63 181.54 423.81 203.12 1.67 1.87 3.69 -16.53 2.39 58.49 1.57\n";
constexpr const char* kDriveName = "2011_09_26_drive_0052_sync";
const std::string kDrive = "raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/";
const std::string kFourth = kDrive + "data/0000000004.png";

/// The object images 0, 1 and 2 are the raw frames 4 and 30 of drive 52 and 9 of a drive that is
/// not there.
class KittiObjectDatasetTest : public FolderTest {
 protected:
  KittiObjectDatasetTest() {
    for (const std::string name : {"000000", "000001", "000002"}) {
      write("training/label_2/" + name + ".txt", kLabel);
      write("training/image_2/" + name + ".png");
    }
    touch({"training/prev_2/000000_01.png", "training/prev_2/000000_02.png",
           "training/prev_2/000002_01.png"});
  }

  /// The images' drives and their frames.
  void write_mapping(const std::string& first, const std::string& second,
                     const std::string& third) const {
    write("devkit/mapping/train_rand.txt", "2,1,3\n");
    write("devkit/mapping/train_mapping.txt",
          "2011_09_26 2011_09_26_drive_0052_sync 00000000" + second +
              "\n2011_09_26 2011_09_26_drive_0052_sync 00000000" + first +
              "\n2011_09_28 2011_09_28_drive_0001_sync 00000000" + third + "\n");
  }

  void add_raw() {
    spec_.raw_root = "raw";
    spec_.devkit = "devkit";
    write_mapping("04", "30", "09");
    for (const char* number : {"00", "01", "02", "03", "04", "05", "06", "07", "09", "30"}) {
      write(kDrive + "data/00000000" + number + ".png");
    }
  }

  void image(const std::string& path, int value) const {
    write_flat_image(at(path), {4, 6}, value);
  }

  std::unique_ptr<Dataset> open() const { return open_kitti_object_dataset(spec_, folder_.path()); }

  Texts faults() const { return faults_of(*open()); }

  static SourceSpec spec() {
    SourceSpec spec;
    spec.dataset = DatasetKind::kKittiObject;
    spec.root = "training";
    return spec;
  }

  SourceSpec spec_ = spec();
};

TEST_F(KittiObjectDatasetTest, EveryLabelFileIsALabelledFrame) {
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("000000", "000001", "000002"));
  EXPECT_EQ(text_of(dataset->labelled_frames()[1]),
            "000001 of : training/image_2/000001.png 0 by label_2/000001.txt");
  EXPECT_THAT(dataset->notes(), IsEmpty());
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("training/label_2/000000.txt", "training/label_2/000001.txt",
                          "training/label_2/000002.txt"));
}

TEST_F(KittiObjectDatasetTest, PreviousFramesCountBackFromZeroAtTenHertz) {
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  EXPECT_THAT(paired(*dataset, 0, {-2, 0}), ElementsAre("present training/prev_2/000000_02.png -2",
                                                        "present " + text_of(frame.frame)));
  EXPECT_DOUBLE_EQ(frame.frame.time_s - dataset->paired_frame(frame, -2).frame.time_s, 0.2);
  EXPECT_THAT(paired(*dataset, 0, {-6, -4, -3, 1, 6}), Each("beyond"));
}

TEST_F(KittiObjectDatasetTest, ReadsAnnotationsByKey) {
  const auto dataset = open();
  EXPECT_EQ(annotation_of(*dataset).original, kLabel);
  EXPECT_THAT(annotation_of(*dataset).boxes, SizeIs(1));
  EXPECT_EQ(dataset->label_place("label_2/000000.txt"), "training/label_2/000000.txt");
}

TEST_F(KittiObjectDatasetTest, AMalformedOrVanishedLabelIsAFaultThatNamesIt) {
  write("training/label_2/000001.txt", "Car 1 2\n");
  const auto dataset = open();
  EXPECT_EQ(fault_of(dataset->annotation("label_2/000001.txt")),
            "expected 15 columns, got 3, in training/label_2/000001.txt:1");
  EXPECT_THAT(fault_of(dataset->annotation("label_2/000009.txt")),
              HasSubstr("in training/label_2/000009.txt"));
}

TEST_F(KittiObjectDatasetTest, ALabelWithoutAnImageIsAMissingFrameAndTheOtherWayRoundANote) {
  write("training/label_2/000007.txt", kLabel);
  write("training/image_2/000008.png");
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("000000", "000001", "000002", "000007"));
  EXPECT_THAT(paired(*dataset, 3, {0}), ElementsAre("missing training/image_2/000007.png 0"));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 image without labels in training/image_2"));
}

TEST_F(KittiObjectDatasetTest, TheMappingGivesSequenceNumbersAndPairedFramesOnBothSides) {
  add_raw();
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  EXPECT_EQ(frame.sequence, kDriveName);
  const std::string data = "present " + kDrive + "data/000000000";
  EXPECT_THAT(paired(*dataset, 0, {-5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5}),
              ElementsAre("beyond", data + "0.png 0", data + "1.png 1",  // prev_2 has no _03
                          "present training/prev_2/000000_02.png 2",
                          "present training/prev_2/000000_01.png 3",
                          "present training/image_2/000000.png 4", data + "5.png 5",
                          data + "6.png 6", data + "7.png 7",
                          "missing " + kDrive + "data/0000000008.png 8", data + "9.png 9"));
  for (const int steps : {-4, -3, -2, -1, 0, 1, 2, 3, 5}) {
    EXPECT_DOUBLE_EQ(dataset->paired_frame(frame, steps).frame.time_s, 0.1 * (4 + steps));
  }
}

TEST_F(KittiObjectDatasetTest, TimestampsTimeThePreviousFramesToo) {
  add_raw();
  const std::string at = "2011-09-26 13:00:";
  write(kDrive + "timestamps.txt", at + "00\n" + at + "01\n" + at + "02\n" + at + "03.25\n" + at +
                                       "05\n" + std::string(25, '\n') + at + "30\n");
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  EXPECT_EQ(frame.frame.time_s, 5);
  EXPECT_EQ(dataset->paired_frame(frame, 0).frame.time_s, 5);
  EXPECT_EQ(dataset->paired_frame(frame, -1).frame.time_s, 3.25);
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("devkit/mapping/train_mapping.txt", "devkit/mapping/train_rand.txt",
                          kDrive + "timestamps.txt", "training/label_2/000000.txt",
                          "training/label_2/000001.txt", "training/label_2/000002.txt"));
}

// Frames 4 and 30 of the drive and the images 0 and 1 that are the same.
TEST_F(KittiObjectDatasetTest, AMappingThatContradictsTheImagesIsAFaultThatNamesBoth) {
  add_raw();
  image("training/image_2/000000.png", 40);
  image(kFourth, 40);
  EXPECT_EQ(faults()[0], "");
  image(kFourth, 41);
  const std::string fault = "expected the image " + kFourth +
                            ", to which devkit/mapping/train_mapping.txt leads, got another, in "
                            "training/image_2/000000.png";
  EXPECT_THAT(faults(), ElementsAre(fault, fault, "")) << "the last one's drive is not there";
  EXPECT_THAT(open()->notes(),
              Contains("no frame of 2011_09_26_drive_0052_sync can be used: " + fault));
}

TEST_F(KittiObjectDatasetTest, ImagesWrittenAnewAreComparedByTheirPixels) {
  add_raw();
  // Without loss, but not the same bytes.
  image("training/image_2/000000.bmp", 40);
  fs::rename(at("training/image_2/000000.bmp"), at("training/image_2/000000.png"));
  image(kFourth, 40);
  EXPECT_EQ(faults()[0], "");
}

TEST_F(KittiObjectDatasetTest, WhereTheLabelledFrameIsNotStoredAPreviousOneIsCompared) {
  add_raw();
  fs::remove(at(kFourth));
  fs::remove(at(kDrive + "data/0000000030.png"));
  image("training/prev_2/000000_01.png", 1);
  image(kDrive + "data/0000000003.png", 2);
  EXPECT_THAT(faults()[1],
              AllOf(HasSubstr("data/0000000003.png"), HasSubstr("prev_2/000000_01.png")));
}

TEST_F(KittiObjectDatasetTest, ADriveOfWhichNothingCanBeComparedIsNoted) {
  add_raw();
  for (const char* name : {"000000", "000001"}) write("training/image_2/"s + name + ".png", "none");
  for (const char* name : {"000000_01", "000000_02"}) {
    fs::remove(at("training/prev_2/"s + name + ".png"));
  }
  EXPECT_EQ(faults()[0], "");
  EXPECT_THAT(open()->notes(), Contains("1 drive of which no image could be compared with what "
                                        "devkit/mapping/train_mapping.txt says"));
}

TEST_F(KittiObjectDatasetTest, APreviousImageBeforeFrameZeroContradictsTheMapping) {
  add_raw();
  write_mapping("01", "30", "00");
  EXPECT_THAT(
      faults(),
      ElementsAre("expected no frame before number 0 of 2011_09_26_drive_0052_sync, got one 2 "
                  "before number 1 (to which devkit/mapping/train_mapping.txt leads), in "
                  "training/prev_2/000000_02.png",
                  "", HasSubstr("training/prev_2/000002_01.png")));
}

TEST_F(KittiObjectDatasetTest, DamagedTimestampsAreAFaultOfTheirDrivesFrames) {
  add_raw();
  write(kDrive + "timestamps.txt", "2011-09-26 13:00:00\n");
  const std::string fault =
      "expected a line for each frame up to 30, got 1 lines, in " + kDrive + "timestamps.txt";
  EXPECT_THAT(faults(), ElementsAre(fault, fault, ""));
}

TEST_F(KittiObjectDatasetTest, FilesLeftOutAreCountedAndNamed) {
  write("training/label_2/img_000007.txt", kLabel);
  touch({"training/image_2/img_000007.png", "training/image_2/000002.jpg",
         "training/prev_2/000000_04.png", "training/prev_2/old/000000_01.png"});
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames().size(), 3u);
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 file left out in training/label_2: img_000007.txt",
                          "2 files left out in training/image_2: 000002.jpg, img_000007.png",
                          "1 file left out in training/prev_2: 000000_04.png"));
}

TEST_F(KittiObjectDatasetTest, WithoutItsDriveAFrameFallsBackOnThePreviousFrames) {
  add_raw();
  write("training/label_2/000003.txt", kLabel);  // past the mapping's end
  write("training/image_2/000003.png");
  const auto dataset = open();
  EXPECT_THAT(paired(*dataset, 2, {-2, -1, 0, 1}),
              ElementsAre("beyond", "present training/prev_2/000002_01.png 8",
                          "present training/image_2/000002.png 9", "beyond"));
  EXPECT_THAT(paired(*dataset, 3, {1}), ElementsAre("beyond"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 labelled frame that devkit/mapping/train_mapping.txt does not know",
                          "1 labelled frame whose raw drive is missing in raw"));
}

TEST_F(KittiObjectDatasetTest, NeedsItsFolders) {
  spec_.root = "elsewhere";
  EXPECT_THROWS(open(), InputError, "expected a folder", "in elsewhere");
  spec_.root = "testing";
  write("testing/image_2/000000.png");
  EXPECT_THROWS(open(), InputError, "expected a folder", "in testing/label_2");
}

TEST_F(KittiObjectDatasetTest, RawRootAndDevkitGoTogether) {
  add_raw();
  spec_.devkit.reset();
  EXPECT_THROWS(open(), UsageError, "devkit");
  spec_ = spec();
  spec_.devkit = "devkit";
  spec_.raw_root = "absent";
  EXPECT_THROWS(open(), InputError, "expected a folder", "in absent");
}

TEST_F(KittiObjectDatasetTest, TheDevkitAloneNamesTheDrives) {
  add_raw();
  spec_.raw_root.reset();
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[0].sequence, kDriveName);
  EXPECT_THAT(paired(*dataset, 0, {-3, -2, 0, 1}),
              ElementsAre("beyond", "present training/prev_2/000000_02.png 2",
                          "present training/image_2/000000.png 4", "beyond"));
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(KittiObjectDatasetTest, TheCalibrationGivesTheProjection) {
  write("training/calib/000000.txt", "P1: 1 2\nP2: 700 0 8 40 0 700 6 2 0 0 1 4\n\n");
  write("training/calib/000001.txt", "P2: 700 0 8\n");
  const auto dataset = open();
  const auto annotation = [&](const char* key) { return dataset->annotation(key); };
  EXPECT_EQ(annotation("label_2/000000.txt")->projection,
            (std::array<double, 12>{700, 0, 8, 40, 0, 700, 6, 2, 0, 0, 1, 4}));
  EXPECT_EQ(fault_of(annotation("label_2/000001.txt")),
            "expected 12 numbers for P2, got 3, in training/calib/000001.txt:1");
  write("training/calib/000001.txt", "P2: 0 0 0 0 0 0 0 0 0 0 0 0\n");
  EXPECT_EQ(fault_of(annotation("label_2/000001.txt")),
            "expected a matrix of full rank for P2, got 'P2: 0 0 0 0 0 0 0 0 0 0 0 0?', in "
            "training/calib/000001.txt:1");
  EXPECT_FALSE(annotation("label_2/000002.txt")->projection);
  EXPECT_THAT(dataset->annotation_files(), Contains("training/calib/000000.txt"));
}

TEST(KittiObjectData, RealFramesReachSixStepsThroughTheMapping) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  SourceSpec spec;
  spec.dataset = DatasetKind::kKittiObject;
  spec.root = "kitti_object/training";
  spec.raw_root = "kitti_raw";
  spec.devkit = "kitti_object/devkit";
  const auto dataset = open_kitti_object_dataset(spec, data);
  EXPECT_THAT(ids_of(*dataset), ElementsAre("000000", "000001", "000008", "001497"));
  for (int steps = -6; steps <= 6; ++steps) {
    const PairedFrame found = dataset->paired_frame(dataset->labelled_frames()[3], steps);
    EXPECT_EQ(found.state, State::kPresent) << steps;
    EXPECT_EQ(found.frame.index, 7 + steps);
    EXPECT_TRUE(fs::is_regular_file(data / found.frame.path));
  }
  EXPECT_THAT(paired(*dataset, 3, {-3, -4}),
              ElementsAre(HasSubstr("prev_2/001497_03.png"), HasSubstr("data/0000000003.png")));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("3 labelled frames whose raw drive is missing in kitti_raw"));
  for (const LabelledFrame& labelled : dataset->labelled_frames()) {
    EXPECT_EQ(labelled.fault, "");
    EXPECT_EQ(annotation_of(*dataset, labelled.label_key).original,
              read_file(data / "kitti_object/training" / labelled.label_key));
  }
}

}  // namespace
}  // namespace eventgan
