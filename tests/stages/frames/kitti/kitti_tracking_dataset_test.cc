#include "stages/frames/kitti/kitti_tracking_dataset.h"

#include "stages/frames/kitti/kitti_label.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

const std::string kColumns = "0 1 -1.79 296.7 161.7 455.2 292.3 2.0 1.8 4.4 -4.5 1.8 13.4 -2.1";

std::string line(const std::string& frame, const std::string& track, const std::string& type) {
  return frame + " " + track + " " + type + " " + kColumns + "\n";
}

TEST(TrackingLabels, GivesAFrameItsOwnLinesByteForByte) {
  const std::string first = line("0", "2", "Van"), second = line("12", "-1", "DontCare"),
                    third = line("12", "5", "Person");
  const TrackingLabels labels(first + second + third, "label_02/0001.txt");
  EXPECT_THAT(labels.frames(), ElementsAre(0, 12));
  const auto annotation = *labels.annotation(12);
  EXPECT_EQ(annotation.original, second + third);
  ASSERT_EQ(annotation.boxes.size(), 2u);
  EXPECT_TRUE(annotation.boxes[0].ignore);
  EXPECT_EQ(annotation.boxes[0].track_id, -1);
  EXPECT_EQ(annotation.boxes[1], (Box{.class_id = kitti_class_id("Person_sitting"),
                                      .xyxy = {296.7, 161.7, 455.2, 292.3},
                                      .truncation = 0,
                                      .occlusion = 1,
                                      .alpha = -1.79f,
                                      .box3d = {2.0f, 1.8f, 4.4f, -4.5f, 1.8f, 13.4f, -2.1f},
                                      .track_id = 5}));
}

// The tracking devkit's readme: "truncated: Integer (0,1,2) indicating the level of truncation",
// where 2 means an ignored object.
TEST(TrackingLabels, TruncationTwoIsAnObjectToIgnore) {
  const auto with_truncation = [](const std::string& level) {
    const std::string text = "0 2 Van " + level + kColumns.substr(1) + "\n";
    return TrackingLabels(text, "l.txt").annotation(0);
  };
  for (const char* level : {"0", "1", "2"}) {
    const Box box = with_truncation(level)->boxes.at(0);
    EXPECT_EQ(box.truncation, std::stof(level));
    EXPECT_EQ(box.ignore, std::string(level) == "2");
  }
  for (const char* level : {"3", "0.5", "-2"}) {
    EXPECT_EQ(fault_of(with_truncation(level)),
              std::string("expected 0, 1, 2 or -1 for truncated, got '") + level + "', in l.txt:1");
  }
}

// As the training labels have it: the unknown location and rotation_y come before the unknown
// size.
TEST(TrackingLabels, DontCareHasTheUnknownThreeDimensionalBox) {
  const TrackingLabels labels(
      "0 -1 DontCare -1 -1 -10.000000 219.310000 188.490000 245.500000 218.560000 -1000.000000 "
      "-1000.000000 -1000.000000 -10.000000 -1.000000 -1.000000 -1.000000\n",
      "l.txt");
  const Box box = labels.annotation(0)->boxes.at(0);
  EXPECT_THAT(box.box3d, ElementsAre(-1, -1, -1, -1000, -1000, -1000, -10));
  EXPECT_TRUE(box.ignore);
}

TEST(TrackingLabels, FindsLinesOfAFrameWhereverTheyStand) {
  const std::string text = line("3", "0", "Car") + line("1", "0", "Car") + line("3", "1", "Car");
  EXPECT_EQ(TrackingLabels(text, "l.txt").annotation(3)->original,
            line("3", "0", "Car") + line("3", "1", "Car"));
}

TEST(TrackingLabels, AFrameWithoutLinesIsEmpty) {
  const TrackingLabels labels(line("3", "0", "Car"), "l.txt");
  EXPECT_EQ(*labels.annotation(4), Annotation());
  EXPECT_THAT(TrackingLabels("", "l.txt").frames(), IsEmpty());
  EXPECT_EQ(*TrackingLabels("\n", "l.txt").annotation(0), Annotation());
}

TEST(TrackingLabels, KeepsTheTextWhenMoved) {
  TrackingLabels labels(line("3", "0", "Car"), "l.txt");
  const TrackingLabels moved = std::move(labels);
  EXPECT_EQ(moved.annotation(3)->original, line("3", "0", "Car"));
}

TEST(TrackingLabels, AMalformedLineIsAFaultOfItsFrameOnly) {
  const TrackingLabels labels(line("0", "0", "Car") + "1 0 Car 0 0\n" + line("2", "x", "Car"),
                              "label_02/0001.txt");
  EXPECT_EQ(fault_of(labels.annotation(0)), "no fault");
  EXPECT_EQ(fault_of(labels.annotation(1)), "expected 17 columns, got 5, in label_02/0001.txt:2");
  EXPECT_EQ(fault_of(labels.annotation(2)),
            "expected a whole number for track id, got 'x', in label_02/0001.txt:3");
}

TEST(TrackingLabels, WholeNumbersMayHaveDecimals) {
  const TrackingLabels labels("\xEF\xBB\xBF" + line("4.0", "3.0", "Car"), "l.txt");
  EXPECT_THAT(labels.frames(), ElementsAre(4));
  EXPECT_EQ(labels.annotation(4)->boxes.at(0).track_id, 3);
}

TEST(TrackingLabels, ALineOfAnUnknownFrameIsAFaultOfAll) {
  for (const std::string number : {"x", "-1", "1.5", "1000000000"}) {
    const TrackingLabels labels(line("0", "0", "Car") + line(number, "0", "Car"), "l.txt");
    for (const int frame : {0, 7}) {
      EXPECT_EQ(fault_of(labels.annotation(frame)),
                "expected a frame number, got '" + number + "', in l.txt:2");
    }
  }
}

const std::string kRest = " 161.7 455.2 292.3 2 1.8 4.4 -4.5 1.8 13 -2\n";
const std::string kFirstLine = "0 2 Van 0 1 -1.79 296.7" + kRest;
const std::string kThird = "2 2 Van 0 1 -1.79 290.7" + kRest;

/// Sequence 0001 with images 0..3 and labels for 0, 2 and 9; 0002 with labels alone; 0003 with
/// images alone.
class KittiTrackingDatasetTest : public FolderTest {
 protected:
  KittiTrackingDatasetTest() {
    for (const char* name :
         {"0001/000000", "0001/000001", "0001/000002", "0001/000003", "0003/000000"}) {
      write(image(name));
    }
    write("tracking/label_02/0001.txt", kFirstLine + kThird + "9 2 Van 0 1 -1.79 290.7" + kRest);
    write("tracking/label_02/0002.txt", kFirstLine);
    spec_.root = "tracking";
  }
  static std::string image(const std::string& name) { return "tracking/image_02/" + name + ".png"; }
  std::unique_ptr<Dataset> open() const {
    return open_kitti_tracking_dataset(spec_, folder_.path());
  }

  SourceSpec spec_;
};

TEST_F(KittiTrackingDatasetTest, EveryImageAndEveryLabelOfALabelledSequenceIsALabelledFrame) {
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("0001/000000", "0001/000001", "0001/000002",
                                            "0001/000003", "0001/000009", "0002/000000"));
  const LabelledFrame& frame = dataset->labelled_frames()[2];
  EXPECT_EQ(text_of(frame),
            "0001/000002 of 0001: tracking/image_02/0001/000002.png 2 by "
            "label_02/0001.txt#2");
  EXPECT_DOUBLE_EQ(frame.frame.time_s, 0.2);
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("tracking/label_02/0001.txt", "tracking/label_02/0002.txt"));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 sequence without labels in tracking/image_02"));
}

TEST_F(KittiTrackingDatasetTest, AnnotationsAreTheFramesLines) {
  const auto dataset = open();
  const auto original = [&](const std::string& key) { return dataset->annotation(key)->original; };
  EXPECT_EQ(original("label_02/0001.txt#0"), kFirstLine);
  EXPECT_EQ(original("label_02/0001.txt#1"), "");
  EXPECT_EQ(original("label_02/0001.txt#2"), kThird);
  EXPECT_EQ(dataset->label_place("label_02/0001.txt#2"), "tracking/label_02/0001.txt#2");
}

TEST_F(KittiTrackingDatasetTest, AKeyOfAnotherFormIsAFault) {
  const auto dataset = open();
  for (const char* key : {"", "#", "label_02/0001.txt", "label_02/0001.txt#", "label_02/0007.txt#0",
                          "label_02/0001.txt#x"}) {
    EXPECT_THAT(fault_of(dataset->annotation(key)), HasSubstr("in tracking"));
  }
}

TEST_F(KittiTrackingDatasetTest, PairedFramesAreTheSequencesImages) {
  EXPECT_THAT(paired(*open(), 2, {-3, -2, 1, 2}),
              ElementsAre("beyond", "present " + image("0001/000000") + " 0",
                          "present " + image("0001/000003") + " 3", "beyond"));
}

TEST_F(KittiTrackingDatasetTest, LostImagesAreMissingHoweverManyAreLost) {
  for (const char* name : {"0001/000000", "0001/000001", "0001/000002"})
    fs::remove(at(image(name)));
  write(image("0001/000005"));
  // 3 and 5 are left: every second frame is not what is stored.
  EXPECT_THAT(paired(*open(), 2, {0, 1, 2}), ElementsAre("present " + image("0001/000003") + " 3",
                                                         "missing " + image("0001/000004") + " 4",
                                                         "present " + image("0001/000005") + " 5"));
}

TEST_F(KittiTrackingDatasetTest, ALabelWithoutAnImageIsAMissingFrame) {
  EXPECT_THAT(paired(*open(), 4, {0}), ElementsAre("missing " + image("0001/000009") + " 9"));
  EXPECT_THAT(paired(*open(), 5, {0}), ElementsAre("missing " + image("0002/000000") + " 0"))
      << "without a folder";
}

TEST_F(KittiTrackingDatasetTest, NoFrameIsBeforeNumberZero) {
  fs::remove(at(image("0001/000000")));
  EXPECT_THAT(paired(*open(), 0, {0, -1}),
              ElementsAre("missing " + image("0001/000000") + " 0", "beyond"));
}

TEST_F(KittiTrackingDatasetTest, FilesLeftOutAreCountedAndNamed) {
  touch({"tracking/label_02/0003.csv", image("0001/frame_7"), "tracking/image_02/0001/000002.jpg"});
  EXPECT_THAT(open()->notes(),
              ElementsAre("2 files left out in tracking/image_02/0001: 000002.jpg, frame_7.png",
                          "1 file left out in tracking/label_02: 0003.csv",
                          "1 sequence without labels in tracking/image_02"));
}

TEST_F(KittiTrackingDatasetTest, NeedsItsFolders) {
  spec_.root = "elsewhere";
  EXPECT_THROWS(open(), InputError, "expected a folder", "in elsewhere/label_02");
  write("elsewhere/label_02/0000.txt");
  EXPECT_THROWS(open(), InputError, "expected a folder", "in elsewhere/image_02");
  write("elsewhere/image_02/0000/note.md");
  EXPECT_THAT(open()->labelled_frames(), IsEmpty());
}

TEST_F(KittiTrackingDatasetTest, AnUnreadableLabelFileIsAFaultOfItsSequenceAlone) {
  const fs::path labels = at("tracking/label_02/0001.txt");
  fs::remove(labels);
  fs::create_symlink("0001.txt", labels);
  const auto dataset = open();
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(4 + 1)) << "the images of 0001";
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(fault_of(*dataset, i),
              i < 4 ? "expected a readable file, got 'Too many levels of symbolic links', in "
                      "tracking/label_02/0001.txt"
                    : "no fault");
  }
  fs::remove(labels);
  fs::create_directory(labels);
  EXPECT_THAT(fault_of(open()->annotation("label_02/0001.txt#2")),
              HasSubstr("'Is a directory', in tracking/label_02/0001.txt"));
}

}  // namespace
}  // namespace eventgan
