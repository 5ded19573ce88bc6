#include "stages/frames/kitti/kitti_object_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
#include "tests/testing/image_file.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::read_file;
using testing::TemporaryFolder;
using testing::write_file;

using State = PairedFrame::State;

TEST(ObjectImages, FindsTheImageAndTheThreeBeforeIt) {
  const TemporaryFolder folder;
  for (const char* name : {"image_2/001497.png", "prev_2/001497_01.png", "prev_2/001497_02.jpg",
                           "prev_2/001497_03.webp", "prev_2/001498_01.png"}) {
    write_file(folder / name, "");
  }
  const ObjectImages images(SourceRoot(".", folder.path()));
  const char* expected[] = {"image_2/001497.png", "prev_2/001497_01.png", "prev_2/001497_02.jpg",
                            "prev_2/001497_03.webp"};
  for (int back = 0; back <= 3; ++back) {
    const auto place = images.at(1497, "001497", -back);
    EXPECT_EQ(place.state, State::kPresent);
    EXPECT_EQ(place.path, expected[back]);
  }
}

TEST(ObjectImages, AnAbsentPreviousFrameIsMissingIfOneFurtherBackIsThere) {
  const TemporaryFolder folder;
  for (const char* name : {"image_2/000001.png", "prev_2/000001_02.png"}) {
    write_file(folder / name, "");
  }
  const ObjectImages images(SourceRoot(".", folder.path()));
  EXPECT_EQ(images.at(1, "000001", -1).state, State::kMissing);
  EXPECT_EQ(images.at(1, "000001", -1).path, "prev_2/000001_01.png");
  EXPECT_EQ(images.at(1, "000001", -2).state, State::kPresent);
  EXPECT_EQ(images.at(1, "000001", -3).state, State::kBeyond);
}

TEST(ObjectImages, AnAbsentImageIsMissingEvenWithoutOthers) {
  const TemporaryFolder folder;
  write_file(folder / "image_2/000001.png", "");
  const ObjectImages images(SourceRoot(".", folder.path()));
  EXPECT_EQ(images.at(7, "000007", 0).state, State::kMissing);
  EXPECT_EQ(images.at(7, "000007", 0).path, "image_2/000007.png");
  EXPECT_EQ(images.at(7, "000007", -1).state, State::kBeyond);
}

TEST(ObjectImages, NeedsAFolderOfImages) {
  const TemporaryFolder folder;
  EXPECT_THROW(ObjectImages(SourceRoot(".", folder.path())), InputError);
}

constexpr const char* kLabel =
    "Car 0.00 0 1.85 387.63 181.54 423.81 203.12 1.67 1.87 3.69 -16.53 2.39 58.49 1.57\n";
constexpr const char* kDrive = "raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/";

/// The object images 0, 1 and 2 are the raw frames 4 and 30 of drive 52 and 9 of a drive that is
/// not there.
class KittiObjectDatasetTest : public ::testing::Test {
 protected:
  KittiObjectDatasetTest() {
    for (const char* name : {"000000", "000001", "000002"}) {
      write("training/label_2/" + std::string(name) + ".txt", kLabel);
      write("training/image_2/" + std::string(name) + ".png");
    }
    write("training/prev_2/000000_01.png");
    write("training/prev_2/000000_02.png");
    write("training/prev_2/000002_01.png");
  }

  void write(const std::string& path, const std::string& text = "") {
    write_file(folder_ / path, text);
  }

  void add_raw() {
    spec_.raw_root = "raw";
    spec_.devkit = "devkit";
    write("devkit/mapping/train_rand.txt", "2,1,3\n");
    write("devkit/mapping/train_mapping.txt",
          "2011_09_26 2011_09_26_drive_0052_sync 0000000030\n"
          "2011_09_26 2011_09_26_drive_0052_sync 0000000004\n"
          "2011_09_28 2011_09_28_drive_0001_sync 0000000009\n");
    for (const char* number : {"00", "01", "02", "03", "04", "05", "06", "07", "09", "30"}) {
      write(std::string(kDrive) + "data/00000000" + number + ".png");
    }
  }

  std::unique_ptr<Dataset> open() const { return open_kitti_object_dataset(spec_, folder_.path()); }

  static SourceSpec spec() {
    SourceSpec spec;
    spec.dataset = DatasetKind::kKittiObject;
    spec.root = "training";
    return spec;
  }

  const testing::TemporaryFolder folder_;
  SourceSpec spec_ = spec();
};

std::vector<std::string> ids(const Dataset& dataset) {
  std::vector<std::string> ids;
  for (const auto& frame : dataset.labelled_frames()) ids.push_back(frame.sample_id);
  return ids;
}

TEST_F(KittiObjectDatasetTest, EveryLabelFileIsALabelledFrame) {
  const auto dataset = open();
  EXPECT_THAT(ids(*dataset), ElementsAre("000000", "000001", "000002"));
  const LabelledFrame& frame = dataset->labelled_frames()[1];
  EXPECT_EQ(frame.frame.path, "training/image_2/000001.png");
  EXPECT_EQ(frame.frame.index, 0);
  EXPECT_EQ(frame.sequence, "");
  EXPECT_THAT(dataset->notes(), IsEmpty());
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("training/label_2/000000.txt", "training/label_2/000001.txt",
                          "training/label_2/000002.txt"));
}

TEST_F(KittiObjectDatasetTest, PreviousFramesCountBackFromZeroAtTenHertz) {
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  const PairedFrame two_back = dataset->paired_frame(frame, -2);
  EXPECT_EQ(two_back.state, State::kPresent);
  EXPECT_EQ(two_back.frame.path, "training/prev_2/000000_02.png");
  EXPECT_EQ(two_back.frame.index, -2);
  EXPECT_DOUBLE_EQ(frame.frame.time_s - two_back.frame.time_s, 0.2);
  EXPECT_EQ(dataset->paired_frame(frame, 0).frame, frame.frame);
  for (const int steps : {-6, -4, -3, 1, 6}) {
    EXPECT_EQ(dataset->paired_frame(frame, steps).state, State::kBeyond) << steps;
  }
}

TEST_F(KittiObjectDatasetTest, ReadsAnnotationsByKey) {
  const auto dataset = open();
  const auto annotation = dataset->annotation(dataset->labelled_frames()[0].label_key);
  ASSERT_FALSE(is_fault(annotation));
  EXPECT_EQ(annotation->original, kLabel);
  EXPECT_EQ(annotation->boxes.size(), 1u);
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key),
            "training/label_2/000000.txt");
}

TEST_F(KittiObjectDatasetTest, AMalformedOrVanishedLabelIsAFaultThatNamesIt) {
  write("training/label_2/000001.txt", "Car 1 2\n");
  const auto dataset = open();
  EXPECT_EQ(dataset->annotation("label_2/000001.txt").fault().reason,
            "expected 15 columns, got 3, in training/label_2/000001.txt:1");
  EXPECT_THAT(dataset->annotation("label_2/000009.txt").fault().reason,
              HasSubstr("in training/label_2/000009.txt"));
}

TEST_F(KittiObjectDatasetTest, ALabelWithoutAnImageIsAMissingFrameAndTheOtherWayRoundANote) {
  write("training/label_2/000007.txt", kLabel);
  write("training/image_2/000008.png");
  const auto dataset = open();
  EXPECT_THAT(ids(*dataset), ElementsAre("000000", "000001", "000002", "000007"));
  const PairedFrame itself = dataset->paired_frame(dataset->labelled_frames()[3], 0);
  EXPECT_EQ(itself.state, State::kMissing);
  EXPECT_EQ(itself.frame.path, "training/image_2/000007.png");
  EXPECT_THAT(dataset->notes(), ElementsAre("1 image without labels in training/image_2"));
}

TEST_F(KittiObjectDatasetTest, TheMappingGivesSequenceNumbersAndPairedFramesOnBothSides) {
  add_raw();
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  EXPECT_EQ(frame.sequence, "2011_09_26_drive_0052_sync");
  EXPECT_EQ(frame.frame.index, 4);
  EXPECT_EQ(frame.frame.path, "training/image_2/000000.png");

  const auto path = [&](int steps) { return dataset->paired_frame(frame, steps).frame.path; };
  EXPECT_EQ(path(-1), "training/prev_2/000000_01.png");
  EXPECT_EQ(path(-2), "training/prev_2/000000_02.png");
  EXPECT_EQ(path(-3), std::string(kDrive) + "data/0000000001.png");  // prev_2 has no _03
  EXPECT_EQ(path(-4), std::string(kDrive) + "data/0000000000.png");
  EXPECT_EQ(path(3), std::string(kDrive) + "data/0000000007.png");
  for (const int steps : {-4, -3, -2, -1, 0, 1, 2, 3, 5}) {
    const PairedFrame paired_frame = dataset->paired_frame(frame, steps);
    EXPECT_EQ(paired_frame.state, State::kPresent) << steps;
    EXPECT_EQ(paired_frame.frame.index, 4 + steps);
    EXPECT_DOUBLE_EQ(paired_frame.frame.time_s, 0.1 * (4 + steps));
  }
  EXPECT_EQ(dataset->paired_frame(frame, 4).state, State::kMissing);  // 8 is absent, 9 is there
  EXPECT_EQ(path(4), std::string(kDrive) + "data/0000000008.png");
  EXPECT_EQ(dataset->paired_frame(frame, -5).state, State::kBeyond);
}

TEST_F(KittiObjectDatasetTest, TimestampsTimeThePreviousFramesToo) {
  add_raw();
  write(std::string(kDrive) + "timestamps.txt",
        "2011-09-26 13:00:00\n2011-09-26 13:00:01\n2011-09-26 13:00:02\n2011-09-26 13:00:03.25\n"
        "2011-09-26 13:00:05\n" +
            std::string(25, '\n') + "2011-09-26 13:00:30\n");
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  EXPECT_EQ(frame.frame.time_s, 5);
  EXPECT_EQ(dataset->paired_frame(frame, 0).frame.time_s, 5);
  EXPECT_EQ(dataset->paired_frame(frame, -1).frame.time_s, 3.25);
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("devkit/mapping/train_mapping.txt", "devkit/mapping/train_rand.txt",
                          std::string(kDrive) + "timestamps.txt", "training/label_2/000000.txt",
                          "training/label_2/000001.txt", "training/label_2/000002.txt"));
}

// Frames 4 and 30 of the drive and the images 0 and 1 that are the same.
TEST_F(KittiObjectDatasetTest, AMappingThatContradictsTheImagesIsAFaultThatNamesBoth) {
  add_raw();
  const auto write_image = [&](const std::string& path, int value) {
    testing::write_flat_image(folder_ / path, {4, 6}, value);
  };
  write_image("training/image_2/000000.png", 40);
  write_image(std::string(kDrive) + "data/0000000004.png", 40);
  EXPECT_EQ(open()->labelled_frames()[0].fault, "");

  write_image(std::string(kDrive) + "data/0000000004.png", 41);
  const std::string fault = "expected the image " + std::string(kDrive) +
                            "data/0000000004.png, to which devkit/mapping/train_mapping.txt leads, "
                            "got another, in training/image_2/000000.png";
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[0].fault, fault);
  EXPECT_EQ(dataset->labelled_frames()[1].fault, fault);  // of the same drive
  EXPECT_EQ(dataset->labelled_frames()[2].fault, "");     // of another, which is not there
  EXPECT_THAT(dataset->notes(),
              Contains("no frame of 2011_09_26_drive_0052_sync can be used: " + fault));
}

TEST_F(KittiObjectDatasetTest, ImagesWrittenAnewAreComparedByTheirPixels) {
  add_raw();
  // Without loss, but not the same bytes.
  testing::write_flat_image(folder_ / "training/image_2/000000.bmp", {4, 6}, 40);
  std::filesystem::remove(folder_ / "training/image_2/000000.png");
  std::filesystem::rename(folder_ / "training/image_2/000000.bmp",
                          folder_ / "training/image_2/000000.png");
  testing::write_flat_image(folder_ / (std::string(kDrive) + "data/0000000004.png"), {4, 6}, 40);
  EXPECT_EQ(open()->labelled_frames()[0].fault, "");
}

TEST_F(KittiObjectDatasetTest, WhereTheLabelledFrameIsNotStoredAPreviousOneIsCompared) {
  add_raw();
  std::filesystem::remove(folder_ / (std::string(kDrive) + "data/0000000004.png"));
  std::filesystem::remove(folder_ / (std::string(kDrive) + "data/0000000030.png"));
  testing::write_flat_image(folder_ / "training/prev_2/000000_01.png", {4, 6}, 1);
  testing::write_flat_image(folder_ / (std::string(kDrive) + "data/0000000003.png"), {4, 6}, 2);
  EXPECT_THAT(open()->labelled_frames()[1].fault,
              AllOf(HasSubstr("data/0000000003.png"), HasSubstr("prev_2/000000_01.png")));
}

TEST_F(KittiObjectDatasetTest, ADriveOfWhichNothingCanBeComparedIsNoted) {
  add_raw();
  write("training/image_2/000000.png", "no image");
  write("training/image_2/000001.png", "no image");
  for (const char* name : {"000000_01", "000000_02"}) {
    std::filesystem::remove(folder_ / ("training/prev_2/" + std::string(name) + ".png"));
  }
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[0].fault, "");
  EXPECT_THAT(dataset->notes(), Contains("1 drive of which no image could be compared with what "
                                         "devkit/mapping/train_mapping.txt says"));
}

TEST_F(KittiObjectDatasetTest, APreviousImageBeforeFrameZeroContradictsTheMapping) {
  add_raw();
  write("devkit/mapping/train_mapping.txt",
        "2011_09_26 2011_09_26_drive_0052_sync 0000000030\n"
        "2011_09_26 2011_09_26_drive_0052_sync 0000000001\n"
        "2011_09_28 2011_09_28_drive_0001_sync 0000000000\n");
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[0].fault,
            "expected no frame before number 0 of 2011_09_26_drive_0052_sync, got one 2 before "
            "number 1 (to which devkit/mapping/train_mapping.txt leads), in "
            "training/prev_2/000000_02.png");
  EXPECT_EQ(dataset->labelled_frames()[1].fault, "");
  EXPECT_THAT(dataset->labelled_frames()[2].fault, HasSubstr("training/prev_2/000002_01.png"));
}

TEST_F(KittiObjectDatasetTest, DamagedTimestampsAreAFaultOfTheirDrivesFrames) {
  add_raw();
  write(std::string(kDrive) + "timestamps.txt", "2011-09-26 13:00:00\n");
  const auto dataset = open();
  const std::string fault = "expected a line for each frame up to 30, got 1 lines, in " +
                            std::string(kDrive) + "timestamps.txt";
  EXPECT_EQ(dataset->labelled_frames()[0].fault, fault);
  EXPECT_EQ(dataset->labelled_frames()[1].fault, fault);
  EXPECT_EQ(dataset->labelled_frames()[2].fault, "");
}

TEST_F(KittiObjectDatasetTest, FilesLeftOutAreCountedAndNamed) {
  write("training/label_2/img_000007.txt", kLabel);
  write("training/image_2/img_000007.png");
  write("training/image_2/000002.jpg");
  write("training/prev_2/000000_04.png");
  write("training/prev_2/old/000000_01.png");
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
  const LabelledFrame& frame = dataset->labelled_frames()[2];
  EXPECT_EQ(frame.frame.index, 9);
  EXPECT_EQ(dataset->paired_frame(frame, -1).state, State::kPresent);
  EXPECT_EQ(dataset->paired_frame(frame, -1).frame.index, 8);
  EXPECT_EQ(dataset->paired_frame(frame, -2).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(frame, 1).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(dataset->labelled_frames()[3], 1).state, State::kBeyond);
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 labelled frame that devkit/mapping/train_mapping.txt does not know",
                          "1 labelled frame whose raw drive is missing in raw"));
}

TEST_F(KittiObjectDatasetTest, NeedsItsFolders) {
  spec_.root = "elsewhere";
  EXPECT_THROW(open(), InputError);
  spec_.root = "testing";
  write("testing/image_2/000000.png");
  EXPECT_THROW(open(), InputError);  // no labels
}

TEST_F(KittiObjectDatasetTest, RawRootAndDevkitGoTogether) {
  add_raw();
  spec_.devkit.reset();
  EXPECT_THROW(open(), UsageError);
  spec_ = spec();
  spec_.devkit = "devkit";
  spec_.raw_root = "absent";
  EXPECT_THROW(open(), InputError);
}

TEST_F(KittiObjectDatasetTest, TheDevkitAloneNamesTheDrives) {
  add_raw();
  spec_.raw_root.reset();
  const auto dataset = open();
  const LabelledFrame& frame = dataset->labelled_frames()[0];
  EXPECT_EQ(frame.sequence, "2011_09_26_drive_0052_sync");
  EXPECT_EQ(frame.frame.index, 4);
  EXPECT_EQ(dataset->paired_frame(frame, -2).state, State::kPresent);
  EXPECT_EQ(dataset->paired_frame(frame, -2).frame.index, 2);
  EXPECT_EQ(dataset->paired_frame(frame, -3).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(frame, 1).state, State::kBeyond);
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(KittiObjectDatasetTest, TheCalibrationGivesTheProjection) {
  write("training/calib/000000.txt", "P1: 1 2\nP2: 700 0 8 40 0 700 6 2 0 0 1 4\n\n");
  write("training/calib/000001.txt", "P2: 700 0 8\n");
  const auto dataset = open();
  const auto annotation = [&](const char* key) { return dataset->annotation(key); };
  EXPECT_EQ(annotation("label_2/000000.txt")->projection,
            (std::array<double, 12>{700, 0, 8, 40, 0, 700, 6, 2, 0, 0, 1, 4}));
  EXPECT_EQ(annotation("label_2/000001.txt").fault().reason,
            "expected 12 numbers for P2, got 3, in training/calib/000001.txt:1");
  write("training/calib/000001.txt", "P2: 0 0 0 0 0 0 0 0 0 0 0 0\n");
  EXPECT_EQ(annotation("label_2/000001.txt").fault().reason,
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
  EXPECT_THAT(ids(*dataset), ElementsAre("000000", "000001", "000008", "001497"));
  const LabelledFrame& frame = dataset->labelled_frames()[3];
  EXPECT_EQ(frame.frame.index, 7);
  for (int steps = -6; steps <= 6; ++steps) {
    const PairedFrame paired_frame = dataset->paired_frame(frame, steps);
    EXPECT_EQ(paired_frame.state, State::kPresent) << steps;
    EXPECT_EQ(paired_frame.frame.index, 7 + steps);
    EXPECT_TRUE(std::filesystem::is_regular_file(data / paired_frame.frame.path));
  }
  EXPECT_THAT(dataset->paired_frame(frame, -3).frame.path, HasSubstr("prev_2/001497_03.png"));
  EXPECT_THAT(dataset->paired_frame(frame, -4).frame.path, HasSubstr("data/0000000003.png"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("3 labelled frames whose raw drive is missing in kitti_raw"));
  for (const LabelledFrame& labelled : dataset->labelled_frames()) {
    EXPECT_EQ(labelled.fault, "");
    const auto annotation = dataset->annotation(labelled.label_key);
    ASSERT_FALSE(is_fault(annotation));
    EXPECT_EQ(annotation->original, read_file(data / "kitti_object/training" / labelled.label_key));
  }
}

}  // namespace
}  // namespace eventgan
