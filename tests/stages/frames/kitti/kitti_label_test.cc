#include "stages/frames/kitti/kitti_label.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "tests/testing/shared_data.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kCar =
    "Car 0.88 3 -0.69 0.00 192.37 402.31 374.00 1.60 1.57 3.23 -2.70 1.74 3.68 -1.29";
constexpr const char* kDontCare =
    "DontCare -1 -1 -10 800.38 163.67 825.45 184.07 -1 -1 -1 -1000 -1000 -1000 -10";

Annotation parsed(const std::string& text) {
  auto outcome = parse_kitti_label(text, "label_2/000008.txt");
  if (is_fault(outcome)) {
    ADD_FAILURE() << outcome.fault().reason;
    return {};
  }
  return *outcome;
}

/// The reason of the fault; empty if there is none.
std::string fault(const std::string& text) {
  auto outcome = parse_kitti_label(text, "label_2/000008.txt");
  return is_fault(outcome) ? outcome.fault().reason : "";
}

/// kCar with its column `index` (from 0) replaced.
std::string car_with(std::size_t index, const std::string& token) {
  std::istringstream columns(kCar);
  std::string line;
  std::string column;
  for (std::size_t i = 0; columns >> column; ++i) line += (i == index ? token : column) + " ";
  return line;
}

TEST(KittiLabel, ReadsEveryColumn) {
  const Annotation annotation = parsed(std::string(kCar) + "\n" + kDontCare + "\n");
  ASSERT_EQ(annotation.boxes.size(), 2u);
  const Box& car = annotation.boxes[0];
  EXPECT_EQ(kitti_label_schema().class_names[static_cast<std::size_t>(car.class_id)], "Car");
  EXPECT_EQ(car.truncation, 0.88f);
  EXPECT_EQ(car.occlusion, 3);
  EXPECT_EQ(car.alpha, -0.69f);
  EXPECT_EQ(car.xyxy, (Rectangle{0, 192.37, 402.31, 374}));
  EXPECT_THAT(car.box3d, ElementsAre(1.60f, 1.57f, 3.23f, -2.70f, 1.74f, 3.68f, -1.29f));
  EXPECT_EQ(car.track_id, -1);
  EXPECT_FALSE(car.ignore);
  EXPECT_EQ(annotation.boxes[1].class_id, kKittiDontCare);
  EXPECT_TRUE(annotation.boxes[1].ignore);
}

TEST(KittiLabel, ADontCareLineHoldsTheValuesForUnknown) {
  Box unknown;  // its defaults
  unknown.class_id = kKittiDontCare;
  unknown.xyxy = {800.38, 163.67, 825.45, 184.07};
  unknown.ignore = true;
  EXPECT_THAT(parsed(kDontCare).boxes, ElementsAre(unknown));
}

/// A car of 100 x height pixels.
int difficulty(const std::string& truncation, const std::string& occlusion, int height) {
  return parsed("Car " + truncation + " " + occlusion + " 0 10 20 110 " +
                std::to_string(20 + height) + " 1 1 1 1 1 1 1\n")
      .boxes.at(0)
      .difficulty;
}

TEST(KittiLabel, TheDifficultyIsTheDevelopmentKits) {
  EXPECT_EQ(difficulty("0.15", "0", 40), 0);
  EXPECT_EQ(difficulty("0.15", "0", 39), 1);
  EXPECT_EQ(difficulty("0.16", "0", 40), 1);
  EXPECT_EQ(difficulty("0.30", "1", 25), 1);
  EXPECT_EQ(difficulty("0.31", "1", 25), 2);
  EXPECT_EQ(difficulty("0.50", "2", 25), 2);
  EXPECT_EQ(difficulty("0.51", "2", 25), -1);
  EXPECT_EQ(difficulty("0.00", "3", 90), -1);
  EXPECT_EQ(difficulty("0.00", "0", 24), -1);
  EXPECT_EQ(difficulty("-1", "0", 90), -1);  // not known
  EXPECT_EQ(difficulty("0.00", "-1", 90), -1);
}

TEST(KittiLabel, KnowsEveryClass) {
  const auto& names = kitti_label_schema().class_names;
  EXPECT_THAT(names, ElementsAre("Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist",
                                 "Tram", "Misc", "DontCare"));
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_EQ(kitti_class_id(names[i]), static_cast<int>(i));
  }
  EXPECT_EQ(kitti_class_id("Person"), kitti_class_id("Person_sitting"));
  EXPECT_EQ(kitti_class_id("Person (sitting)"), kitti_class_id("Person_sitting"));
  EXPECT_EQ(kitti_class_id("car"), -1);
}

TEST(KittiLabel, KeepsTheTextByteForByte) {
  for (const std::string& text :
       {std::string(), std::string("\n"), std::string(kCar), std::string(kCar) + "\r\n",
        std::string(kCar) + "  \n\n" + kDontCare + "\t\r\n"}) {
    EXPECT_EQ(parsed(text).original, text);
  }
}

TEST(KittiLabel, AByteOrderMarkIsPassedOver) {
  const std::string line = "Car 0 0 -10 1 2 3 4 -1 -1 -1 -1000 -1000 -1000 -10\n";
  EXPECT_EQ(parsed("\xEF\xBB\xBF" + line).boxes, parsed(line).boxes);
  EXPECT_EQ(parsed("\xEF\xBB\xBF" + line).original, "\xEF\xBB\xBF" + line);
}

TEST(KittiLabel, AnEmptyFileHasNoObjects) { EXPECT_TRUE(parsed("").boxes.empty()); }

TEST(KittiLabel, TakesAScoreAndLeavesItOut) {
  EXPECT_EQ(parsed(std::string(kCar) + " 0.97").boxes, parsed(kCar).boxes);
}

TEST(KittiLabel, AScoreMustBeANumber) {
  for (const char* token : {"high", "nan", "0.9x"}) {
    EXPECT_EQ(fault(std::string(kCar) + " " + token),
              std::string("expected a finite number for score, got '") + token +
                  "', in label_2/000008.txt:1");
  }
}

// The object devkit's readme: "truncated: Float from 0 (non-truncated) to 1 (truncated)",
// "occluded: Integer (0,1,2,3)"; -1 is where DontCare has none.
TEST(KittiLabel, TruncatedAndOccludedHaveTheirRanges) {
  for (const char* token : {"-1", "0", "0.50", "1.00"}) EXPECT_EQ(fault(car_with(1, token)), "");
  for (const char* token : {"1.5", "1.01", "2", "-0.5", "-2"}) {
    EXPECT_EQ(fault(car_with(1, token)),
              std::string("expected a number from 0 to 1, or -1 for truncated, got '") + token +
                  "', in label_2/000008.txt:1");
  }
  for (const char* token : {"-1", "0", "1", "2", "3"}) EXPECT_EQ(fault(car_with(2, token)), "");
  for (const char* token : {"4", "-2", "99"}) {
    EXPECT_EQ(fault(car_with(2, token)),
              std::string("expected a whole number from 0 to 3, or -1 for occluded, got '") +
                  token + "', in label_2/000008.txt:1");
  }
}

TEST(KittiLabel, ANumberTooSmallForItsColumnIsZero) {
  EXPECT_EQ(parsed(car_with(3, "1e-50")).boxes.at(0).alpha, 0.0f);
  EXPECT_EQ(parsed(car_with(3, "-1e-400")).boxes.at(0).alpha, 0.0f);
  EXPECT_EQ(parsed(car_with(4, "1e-400")).boxes.at(0).xyxy.left, 0.0);
}

TEST(KittiLabel, TakesWindowsLineEnds) {
  EXPECT_EQ(parsed(std::string(kCar) + "\r\n" + kDontCare + "\r\n").boxes,
            parsed(std::string(kCar) + "\n" + kDontCare).boxes);
}

TEST(KittiLabel, AWrongNumberOfColumnsIsAFaultThatNamesTheLine) {
  EXPECT_EQ(fault(std::string(kCar) + "\nCar 0.00 0 1.5 1 2 3\n"),
            "expected 15 columns, got 7, in label_2/000008.txt:2");
  EXPECT_EQ(fault(std::string(kCar) + " 0.9 0.8"),
            "expected 15 columns, got 17, in label_2/000008.txt:1");
}

TEST(KittiLabel, LineNumbersCountBlankLines) {
  EXPECT_THAT(fault("\r\n\r\nCar\n"), HasSubstr("label_2/000008.txt:3"));
}

TEST(KittiLabel, AnUnknownTypeIsAFault) {
  EXPECT_THAT(fault(car_with(0, "Lorry")),
              AllOf(HasSubstr("expected one of Car, Van"), HasSubstr("got 'Lorry'"),
                    HasSubstr("in label_2/000008.txt:1")));
}

TEST(KittiLabel, EveryColumnMustBeAFiniteNumber) {
  for (std::size_t column = 1; column < 15; ++column) {
    for (const char* token : {"nan", "inf", "-inf", "x", "1.5x", "1e400"}) {
      EXPECT_THAT(fault(car_with(column, token)),
                  AllOf(HasSubstr(std::string("got '") + token + "'"), HasSubstr("000008.txt:1")))
          << column;
    }
  }
  EXPECT_EQ(fault(car_with(4, "4x")),
            "expected a finite number for left, got '4x', in label_2/000008.txt:1");
}

TEST(KittiLabel, OccludedMustBeAWholeNumber) {
  EXPECT_EQ(fault(car_with(2, "1.5")),
            "expected a whole number from 0 to 3, or -1 for occluded, got '1.5', in "
            "label_2/000008.txt:1");
}

TEST(KittiLabel, AWholeNumberMayHaveDecimals) {
  EXPECT_EQ(parsed(car_with(2, "2.0")).boxes, parsed(car_with(2, "2")).boxes);
}

TEST(KittiLabel, ReadsTheOriginalLabels) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto text = testing::read_file(data / "kitti_object/training/label_2/000008.txt");
  const Annotation annotation = parsed(text);
  EXPECT_EQ(annotation.original, text);
  ASSERT_EQ(annotation.boxes.size(), 10u);  // six cars, four DontCare
  EXPECT_EQ(annotation.boxes[2].xyxy, (Rectangle{937.29, 197.39, 1241, 374}));
  EXPECT_EQ(std::ranges::count_if(annotation.boxes, &Box::ignore), 4);
}

TEST(KittiLabel, ReadsLabelsWhoseOtherColumnsAreUnknown) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const Annotation annotation =
      parsed(testing::read_file(data / "kitti_object/training/label_2/001497.txt"));
  ASSERT_EQ(annotation.boxes.size(), 8u);
  EXPECT_EQ(annotation.boxes[0].truncation, -1);
  EXPECT_EQ(annotation.boxes[0].occlusion, -1);
}

}  // namespace
}  // namespace eventgan
