#include "stages/frames/kitti/kitti_tracking_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
#include "stages/frames/kitti/kitti_label.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::write_file;

const std::string kColumns = "0 1 -1.79 296.7 161.7 455.2 292.3 2.0 1.8 4.4 -4.5 1.8 13.4 -2.1";

std::string line(const std::string& frame, const std::string& track, const std::string& type) {
  return frame + " " + track + " " + type + " " + kColumns + "\n";
}

TEST(TrackingLabels, GivesAFrameItsOwnLinesByteForByte) {
  const std::string first = line("0", "2", "Van");
  const std::string second = line("12", "-1", "DontCare");
  const std::string third = line("12", "5", "Person");
  const TrackingLabels labels(first + second + third, "label_02/0001.txt");
  EXPECT_THAT(labels.frames(), ElementsAre(0, 12));

  const auto annotation = *labels.annotation(12);
  EXPECT_EQ(annotation.original, second + third);
  ASSERT_EQ(annotation.boxes.size(), 2u);
  EXPECT_TRUE(annotation.boxes[0].ignore);
  EXPECT_EQ(annotation.boxes[0].track_id, -1);
  EXPECT_EQ(annotation.boxes[1].track_id, 5);
  EXPECT_EQ(annotation.boxes[1].class_id, kitti_class_id("Person_sitting"));
  EXPECT_EQ(annotation.boxes[1].xyxy, (Rectangle{296.7, 161.7, 455.2, 292.3}));
  EXPECT_THAT(annotation.boxes[1].box3d, ElementsAre(2.0f, 1.8f, 4.4f, -4.5f, 1.8f, 13.4f, -2.1f));
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
    EXPECT_EQ(with_truncation(level).fault().reason,
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
  const TrackingLabels labels(line("3", "0", "Car") + line("1", "0", "Car") + line("3", "1", "Car"),
                              "l.txt");
  EXPECT_EQ(labels.annotation(3)->original, line("3", "0", "Car") + line("3", "1", "Car"));
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

std::string fault(const TrackingLabels& labels, std::int64_t frame) {
  const auto outcome = labels.annotation(frame);
  return is_fault(outcome) ? outcome.fault().reason : "";
}

TEST(TrackingLabels, AMalformedLineIsAFaultOfItsFrameOnly) {
  const TrackingLabels labels(line("0", "0", "Car") + "1 0 Car 0 0\n" + line("2", "x", "Car"),
                              "label_02/0001.txt");
  EXPECT_EQ(fault(labels, 0), "");
  EXPECT_EQ(fault(labels, 1), "expected 17 columns, got 5, in label_02/0001.txt:2");
  EXPECT_EQ(fault(labels, 2),
            "expected a whole number for track id, got 'x', in label_02/0001.txt:3");
}

TEST(TrackingLabels, WholeNumbersMayHaveDecimals) {
  const TrackingLabels labels("\xEF\xBB\xBF" + line("4.0", "3.0", "Car"), "l.txt");
  EXPECT_THAT(labels.frames(), ::testing::ElementsAre(4));
  EXPECT_EQ(labels.annotation(4)->boxes.at(0).track_id, 3);
}

TEST(TrackingLabels, ALineOfAnUnknownFrameIsAFaultOfAll) {
  for (const char* number : {"x", "-1", "1.5", "1000000000"}) {
    const TrackingLabels labels(line("0", "0", "Car") + line(number, "0", "Car"), "l.txt");
    EXPECT_EQ(fault(labels, 0),
              std::string("expected a frame number, got '") + number + "', in l.txt:2");
    EXPECT_EQ(fault(labels, 7), fault(labels, 0));
  }
}

using State = PairedFrame::State;

constexpr const char* kFirstLine =
    "0 2 Van 0 1 -1.79 296.7 161.7 455.2 292.3 2 1.8 4.4 -4.5 1.8 13 -2\n";
constexpr const char* kThird =
    "2 2 Van 0 1 -1.79 290.7 161.7 455.2 292.3 2 1.8 4.4 -4.5 1.8 13 -2\n";
constexpr const char* kNinth =
    "9 2 Van 0 1 -1.79 290.7 161.7 455.2 292.3 2 1.8 4.4 -4.5 1.8 13 -2\n";

/// Sequence 0001 with images 0..3 and labels for 0, 2 and 9; 0002 with labels alone; 0003 with
/// images alone.
class KittiTrackingDatasetTest : public ::testing::Test {
 protected:
  KittiTrackingDatasetTest() {
    for (const char* name :
         {"0001/000000", "0001/000001", "0001/000002", "0001/000003", "0003/000000"}) {
      write_file(folder_ / ("tracking/image_02/" + std::string(name) + ".png"), "");
    }
    write_file(folder_ / "tracking/label_02/0001.txt", std::string(kFirstLine) + kThird + kNinth);
    write_file(folder_ / "tracking/label_02/0002.txt", kFirstLine);
    spec_.root = "tracking";
  }

  std::unique_ptr<Dataset> open() const {
    return open_kitti_tracking_dataset(spec_, folder_.path());
  }

  const testing::TemporaryFolder folder_;
  SourceSpec spec_;
};

TEST_F(KittiTrackingDatasetTest, EveryImageAndEveryLabelOfALabelledSequenceIsALabelledFrame) {
  const auto dataset = open();
  std::vector<std::string> ids;
  for (const auto& frame : dataset->labelled_frames()) ids.push_back(frame.sample_id);
  EXPECT_THAT(ids, ElementsAre("0001/000000", "0001/000001", "0001/000002", "0001/000003",
                               "0001/000009", "0002/000000"));
  const LabelledFrame& frame = dataset->labelled_frames()[2];
  EXPECT_EQ(frame.sequence, "0001");
  EXPECT_EQ(frame.label_key, "label_02/0001.txt#2");
  EXPECT_EQ(frame.frame.path, "tracking/image_02/0001/000002.png");
  EXPECT_EQ(frame.frame.index, 2);
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
    const auto outcome = dataset->annotation(key);
    ASSERT_TRUE(is_fault(outcome)) << key;
    EXPECT_THAT(outcome.fault().reason, HasSubstr("in tracking"));
  }
}

TEST_F(KittiTrackingDatasetTest, PairedFramesAreTheSequencesImages) {
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  EXPECT_EQ(dataset->paired_frame(frames[2], -2).frame.path, "tracking/image_02/0001/000000.png");
  EXPECT_EQ(dataset->paired_frame(frames[2], 1).state, State::kPresent);
  EXPECT_EQ(dataset->paired_frame(frames[2], 2).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(frames[2], -3).state, State::kBeyond);
}

TEST_F(KittiTrackingDatasetTest, LostImagesAreMissingHoweverManyAreLost) {
  for (const char* name : {"000000", "000001", "000002"}) {
    std::filesystem::remove(folder_ / ("tracking/image_02/0001/" + std::string(name) + ".png"));
  }
  write_file(folder_ / "tracking/image_02/0001/000005.png", "");
  const auto dataset = open();  // 3 and 5 are left: every second frame is not what is stored
  const LabelledFrame& third = dataset->labelled_frames()[2];
  ASSERT_EQ(third.frame.index, 3);
  EXPECT_EQ(dataset->paired_frame(third, 1).state, State::kMissing);
  EXPECT_EQ(dataset->paired_frame(third, 1).frame.path, "tracking/image_02/0001/000004.png");
  EXPECT_EQ(dataset->paired_frame(third, 2).frame.index, 5);
}

TEST_F(KittiTrackingDatasetTest, ALabelWithoutAnImageIsAMissingFrame) {
  const auto dataset = open();
  const PairedFrame ninth = dataset->paired_frame(dataset->labelled_frames()[4], 0);
  EXPECT_EQ(ninth.state, State::kMissing);
  EXPECT_EQ(ninth.frame.path, "tracking/image_02/0001/000009.png");
  const PairedFrame without_folder = dataset->paired_frame(dataset->labelled_frames()[5], 0);
  EXPECT_EQ(without_folder.state, State::kMissing);
  EXPECT_EQ(without_folder.frame.path, "tracking/image_02/0002/000000.png");
}

TEST_F(KittiTrackingDatasetTest, NoFrameIsBeforeNumberZero) {
  std::filesystem::remove(folder_ / "tracking/image_02/0001/000000.png");
  const auto dataset = open();
  const LabelledFrame& first = dataset->labelled_frames()[0];
  EXPECT_EQ(dataset->paired_frame(first, 0).state, State::kMissing);
  EXPECT_EQ(dataset->paired_frame(first, -1).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(first, -1).frame.path, "");
}

TEST_F(KittiTrackingDatasetTest, FilesLeftOutAreCountedAndNamed) {
  write_file(folder_ / "tracking/label_02/0003.csv", "");
  write_file(folder_ / "tracking/image_02/0001/frame_7.png", "");
  write_file(folder_ / "tracking/image_02/0001/000002.jpg", "");
  EXPECT_THAT(open()->notes(),
              ElementsAre("2 files left out in tracking/image_02/0001: 000002.jpg, frame_7.png",
                          "1 file left out in tracking/label_02: 0003.csv",
                          "1 sequence without labels in tracking/image_02"));
}

TEST_F(KittiTrackingDatasetTest, NeedsItsFolders) {
  spec_.root = "elsewhere";
  EXPECT_THROW(open(), InputError);
  write_file(folder_ / "elsewhere/label_02/0000.txt", "");
  EXPECT_THROW(open(), InputError);
  write_file(folder_ / "elsewhere/image_02/0000/note.md", "");
  EXPECT_THAT(open()->labelled_frames(), IsEmpty());
}

TEST_F(KittiTrackingDatasetTest, AnUnreadableLabelFileIsAFaultOfItsSequenceAlone) {
  std::filesystem::remove(folder_ / "tracking/label_02/0001.txt");
  std::filesystem::create_symlink("0001.txt", folder_ / "tracking/label_02/0001.txt");
  const auto dataset = open();
  std::size_t faults = 0;
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    const auto annotation = dataset->annotation(frame.label_key);
    EXPECT_EQ(is_fault(annotation), frame.sequence == "0001") << frame.sample_id;
    if (!is_fault(annotation)) continue;
    EXPECT_EQ(annotation.fault().reason,
              "expected a readable file, got 'Too many levels of symbolic links', in "
              "tracking/label_02/0001.txt");
    ++faults;
  }
  EXPECT_EQ(faults, 4u);  // its images

  std::filesystem::remove(folder_ / "tracking/label_02/0001.txt");
  std::filesystem::create_directory(folder_ / "tracking/label_02/0001.txt");
  EXPECT_THAT(open()->annotation("label_02/0001.txt#2").fault().reason,
              HasSubstr("'Is a directory', in tracking/label_02/0001.txt"));
}

}  // namespace
}  // namespace eventgan
