#include "stages/frames/kitti/kitti_label.h"

#include <algorithm>
#include <sstream>

#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

constexpr const char* kCar =
    "Car 0.88 3 -0.69 0.00 192.37 402.31 374.00 1.60 1.57 3.23 -2.70 1.74 3.68 -1.29";
constexpr const char* kDontCare =
    "DontCare -1 -1 -10 800.38 163.67 825.45 184.07 -1 -1 -1 -1000 -1000 -1000 -10";

Annotation parsed(const std::string& text) {
  const auto read = parse_kitti_label(text, "label_2/000008.txt");
  EXPECT_EQ(fault_of(read), "no fault");
  return is_fault(read) ? Annotation() : *read;
}

/// The reason of the fault; empty if there is none.
std::string fault(const std::string& text) {
  return fault_of(parse_kitti_label(text, "label_2/000008.txt"));
}

/// kCar with its column `index` (from 0) replaced.
std::string car_with(std::size_t index, const std::string& token) {
  std::istringstream columns(kCar);
  std::string line, column;
  for (std::size_t i = 0; columns >> column; ++i) line += (i == index ? token : column) + " ";
  return line;
}

TEST(KittiLabel, ReadsEveryColumn) {
  const Annotation annotation = parsed(std::string(kCar) + "\n" + kDontCare + "\n");
  ASSERT_EQ(annotation.boxes.size(), 2u);
  EXPECT_EQ(annotation.boxes[0],
            (Box{.class_id = kitti_class_id("Car"),
                 .xyxy = {0, 192.37, 402.31, 374},
                 .truncation = 0.88f,
                 .occlusion = 3,
                 .alpha = -0.69f,
                 .box3d = {1.60f, 1.57f, 3.23f, -2.70f, 1.74f, 3.68f, -1.29f}}));
  // A DontCare line holds the values for unknown.
  EXPECT_EQ(
      annotation.boxes[1],
      (Box{.class_id = kKittiDontCare, .xyxy = {800.38, 163.67, 825.45, 184.07}, .ignore = true}));
}

/// A car of 100 x height pixels.
int difficulty(const std::string& truncation, const std::string& occlusion, int height) {
  return parsed("Car " + truncation + " " + occlusion + " 0 10 20 110 " +
                std::to_string(20 + height) + " 1 1 1 1 1 1 1\n")
      .boxes.at(0)
      .difficulty;
}

TEST(KittiLabel, TheDifficultyIsTheDevelopmentKits) {
  const struct {
    const char *truncation, *occlusion;
    int height, difficulty;
  } cases[] = {{"0.15", "0", 40, 0},  {"0.15", "0", 39, 1},  {"0.16", "0", 40, 1},
               {"0.30", "1", 25, 1},  {"0.31", "1", 25, 2},  {"0.50", "2", 25, 2},
               {"0.51", "2", 25, -1}, {"0.00", "3", 90, -1}, {"0.00", "0", 24, -1},
               {"-1", "0", 90, -1},   {"0.00", "-1", 90, -1}};  // not known
  for (const auto& [truncation, occlusion, height, expected] : cases) {
    EXPECT_EQ(difficulty(truncation, occlusion, height), expected)
        << truncation << " " << occlusion << " " << height;
  }
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
  for (const std::string token : {"high", "nan", "0.9x"}) {
    EXPECT_EQ(fault(kCar + " "s + token),
              "expected a finite number for score, got '" + token + "', in label_2/000008.txt:1");
  }
}

// The object devkit's readme: "truncated: Float from 0 (non-truncated) to 1 (truncated)",
// "occluded: Integer (0,1,2,3)"; -1 is where DontCare has none.
TEST(KittiLabel, TruncatedAndOccludedHaveTheirRanges) {
  const struct {
    std::size_t column;
    std::vector<const char*> sound;
    Texts wrong;
    std::string expected;
  } cases[] = {{1,
                {"-1", "0", "0.50", "1.00"},
                {"1.5", "1.01", "2", "-0.5", "-2"},
                "expected a number from 0 to 1, or -1 for truncated"},
               {2,
                {"-1", "0", "1", "2", "3"},
                {"4", "-2", "99", "1.5"},
                "expected a whole number from 0 to 3, or -1 for occluded"}};
  for (const auto& [column, sound, wrong, expected] : cases) {
    for (const char* token : sound) EXPECT_EQ(fault(car_with(column, token)), "no fault") << token;
    for (const std::string& token : wrong) {
      EXPECT_EQ(fault(car_with(column, token)),
                expected + ", got '" + token + "', in label_2/000008.txt:1");
    }
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
  EXPECT_EQ(fault(kCar + "\nCar 0.00 0 1.5 1 2 3\n"s),
            "expected 15 columns, got 7, in label_2/000008.txt:2");
  EXPECT_EQ(fault(kCar + " 0.9 0.8"s), "expected 15 columns, got 17, in label_2/000008.txt:1");
  EXPECT_THAT(fault("\r\n\r\nCar\n"), HasSubstr("label_2/000008.txt:3")) << "blank lines count";
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

TEST(KittiLabel, AWholeNumberMayHaveDecimals) {
  EXPECT_EQ(parsed(car_with(2, "2.0")).boxes, parsed(car_with(2, "2")).boxes);
}

TEST(KittiLabel, ReadsTheOriginalLabels) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto text = read_file(data / "kitti_object/training/label_2/000008.txt");
  const Annotation annotation = parsed(text);
  EXPECT_EQ(annotation.original, text);
  ASSERT_EQ(annotation.boxes.size(), 10u);  // six cars, four DontCare
  EXPECT_EQ(annotation.boxes[2].xyxy, (Rectangle{937.29, 197.39, 1241, 374}));
  EXPECT_EQ(std::ranges::count_if(annotation.boxes, &Box::ignore), 4);
}

TEST(KittiLabel, ReadsLabelsWhoseOtherColumnsAreUnknown) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const Annotation annotation =
      parsed(read_file(data / "kitti_object/training/label_2/001497.txt"));
  ASSERT_EQ(annotation.boxes.size(), 8u);
  EXPECT_EQ(annotation.boxes[0].truncation, -1);
  EXPECT_EQ(annotation.boxes[0].occlusion, -1);
}

}  // namespace
}  // namespace eventgan
