#include "stages/frames/kitti/tracking_labels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/frames/kitti/kitti_label.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

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

  const auto annotation = std::get<Annotation>(labels.annotation(12));
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
    const Box box = std::get<Annotation>(with_truncation(level)).boxes.at(0);
    EXPECT_EQ(box.truncation, std::stof(level));
    EXPECT_EQ(box.ignore, std::string(level) == "2");
  }
  for (const char* level : {"3", "0.5", "-2"}) {
    EXPECT_EQ(std::get<SampleFault>(with_truncation(level)).reason,
              std::string("expected 0, 1, 2 or -1 for truncated, got '") + level + "', in l.txt:1");
  }
}

// As the training labels have it: the unknown location and rotation_y stand before the unknown
// size.
TEST(TrackingLabels, DontCareHasTheUnknownThreeDimensionalBox) {
  const TrackingLabels labels(
      "0 -1 DontCare -1 -1 -10.000000 219.310000 188.490000 245.500000 218.560000 -1000.000000 "
      "-1000.000000 -1000.000000 -10.000000 -1.000000 -1.000000 -1.000000\n",
      "l.txt");
  const Box box = std::get<Annotation>(labels.annotation(0)).boxes.at(0);
  EXPECT_THAT(box.box3d, ElementsAre(-1, -1, -1, -1000, -1000, -1000, -10));
  EXPECT_TRUE(box.ignore);
}

TEST(TrackingLabels, FindsLinesOfAFrameWhereverTheyStand) {
  const TrackingLabels labels(line("3", "0", "Car") + line("1", "0", "Car") + line("3", "1", "Car"),
                              "l.txt");
  EXPECT_EQ(std::get<Annotation>(labels.annotation(3)).original,
            line("3", "0", "Car") + line("3", "1", "Car"));
}

TEST(TrackingLabels, AFrameWithoutLinesIsEmpty) {
  const TrackingLabels labels(line("3", "0", "Car"), "l.txt");
  EXPECT_EQ(std::get<Annotation>(labels.annotation(4)), Annotation());
  EXPECT_THAT(TrackingLabels("", "l.txt").frames(), IsEmpty());
  EXPECT_EQ(std::get<Annotation>(TrackingLabels("\n", "l.txt").annotation(0)), Annotation());
}

TEST(TrackingLabels, KeepsTheTextWhenMoved) {
  TrackingLabels labels(line("3", "0", "Car"), "l.txt");
  const TrackingLabels moved = std::move(labels);
  EXPECT_EQ(std::get<Annotation>(moved.annotation(3)).original, line("3", "0", "Car"));
}

std::string fault(const TrackingLabels& labels, std::int64_t frame) {
  const auto outcome = labels.annotation(frame);
  return is_fault(outcome) ? std::get<SampleFault>(outcome).reason : "";
}

TEST(TrackingLabels, AMalformedLineIsAFaultOfItsFrameOnly) {
  const TrackingLabels labels(line("0", "0", "Car") + "1 0 Car 0 0\n" + line("2", "x", "Car"),
                              "label_02/0001.txt");
  EXPECT_EQ(fault(labels, 0), "");
  EXPECT_EQ(fault(labels, 1), "expected 17 columns, got 5, in label_02/0001.txt:2");
  EXPECT_EQ(fault(labels, 2),
            "expected a whole number for track id, got 'x', in label_02/0001.txt:3");
}

TEST(TrackingLabels, ALineOfAnUnknownFrameIsAFaultOfAll) {
  for (const char* number : {"x", "-1", "1.5", "1000000000"}) {
    const TrackingLabels labels(line("0", "0", "Car") + line(number, "0", "Car"), "l.txt");
    EXPECT_EQ(fault(labels, 0),
              std::string("expected a frame number, got '") + number + "', in l.txt:2");
    EXPECT_EQ(fault(labels, 7), fault(labels, 0));
  }
}

}  // namespace
}  // namespace eventgan
