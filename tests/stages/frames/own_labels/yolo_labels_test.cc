#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "stages/frames/own_labels/yolo_text.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

constexpr ImageSize kYoloImage{30, 40};

YoloSchema classes() { return parse_yolo_classes("cat\ndog\n", "classes.txt"); }

std::string fault_of(const std::string& text, const YoloSchema& schema = classes()) {
  const auto read = parse_yolo_text(text, schema, kYoloImage, "a.txt");
  return is_fault(read) ? read.fault().reason : "no fault";
}

TEST(YoloText, ABoxIsCentreAndSizeAsShares) {
  const std::string text = "1 0.5 0.5 0.25 0.2\r\n\n0 0 1 0.5 1";
  const auto read = parse_yolo_text(text, classes(), kYoloImage, "a.txt");
  ASSERT_FALSE(is_fault(read)) << read.fault().reason;
  const Annotation& annotation = *read;
  ASSERT_EQ(annotation.boxes.size(), 2u);
  EXPECT_EQ(annotation.boxes[0].class_id, 1);
  EXPECT_EQ(annotation.boxes[0].xyxy, (Rectangle{15, 12, 25, 18}));
  EXPECT_EQ(annotation.boxes[1].xyxy, (Rectangle{-10, 15, 10, 45}));
  EXPECT_EQ(annotation.original, text);
  EXPECT_EQ(fault_of(""), "no fault");
}

Annotation read_yolo(const std::string& text) {
  const auto read = parse_yolo_text(text, classes(), kYoloImage, "a.txt");
  EXPECT_FALSE(is_fault(read)) << read.fault().reason;
  return *read;
}

// Of 40 x 30: 1.01 is 40.4 and 30.3, -0.01 is -0.4 and -0.3.
TEST(YoloText, ASharesRoundingReachesBeyondTheImage) {
  const Annotation annotation = read_yolo("0 0.5 0.5 1.01 0.5\n0 -0.01 1.01 0.5 0.5");
  ASSERT_EQ(annotation.boxes.size(), 2u);
  EXPECT_EQ(annotation.boxes[0].xyxy, (Rectangle{20 - 20.2, 7.5, 20 + 20.2, 22.5}));
  EXPECT_EQ(annotation.boxes[1].xyxy, (Rectangle{-0.4 - 10, 30.3 - 7.5, -0.4 + 10, 30.3 + 7.5}));
  EXPECT_EQ(fault_of("0 0.5 0.5 1.0101 0.5"), "expected a share 0..1, got '1.0101', in a.txt:1");
  EXPECT_EQ(fault_of("0 -0.0101 0.5 1 0.5"), "expected a share 0..1, got '-0.0101', in a.txt:1");
}

TEST(YoloText, AnOutlineIsTheBoxAroundIt) {
  const Annotation annotation =
      read_yolo("1 0.25 0.3 0.5 0.2 0.125 0.4 0.2 0.4\n0 0.5 0.5 0.25 0.2\n0 0 0 1.005 0 1 1");
  ASSERT_EQ(annotation.boxes.size(), 3u);
  EXPECT_EQ(annotation.boxes[0].class_id, 1);
  EXPECT_EQ(annotation.boxes[0].xyxy, (Rectangle{5, 6, 20, 12}));
  EXPECT_EQ(annotation.boxes[1].xyxy, (Rectangle{15, 12, 25, 18}));
  EXPECT_EQ(annotation.boxes[2].xyxy, (Rectangle{0, 0, 1.005 * 40, 30}));
  EXPECT_EQ(fault_of("0 0.1 0.2 0.3 x 0.1 0.2"), "expected a number, got 'x', in a.txt:1");
  EXPECT_EQ(fault_of("0 0.1 0.2 0.3 0.1 0.1 2"), "expected a share 0..1, got '2', in a.txt:1");
  EXPECT_THAT(read_yolo("0 0.1 0.1 0.2 0.1 0.3 0.1").left_out,
              ElementsAre(HasSubstr("expected a box of a width and height above 0, got 8 x 0")));
}

TEST(YoloText, ABadBoxDoesNotLoseTheOthers) {
  const Annotation annotation =
      read_yolo("0 0.5 0.5 0 0.1\n1 0.5 0.5 0.25 0.2\n0 1.01 0.5 0.01 0.5");
  ASSERT_EQ(annotation.boxes.size(), 1u);
  EXPECT_EQ(annotation.boxes[0].class_id, 1);
  EXPECT_THAT(
      annotation.left_out,
      ElementsAre("expected a box of a width and height above 0, got 0 x 3, in a.txt:1",
                  HasSubstr("expected a box within the image of 40x30, got one from (40.")));
  EXPECT_THAT(annotation.left_out[1], ::testing::EndsWith(", in a.txt:3"));
}

TEST(YoloText, ALineThatIsThereAlreadyIsLeftOut) {
  const Annotation annotation =
      read_yolo("0 0.5 0.5 0.25 0.2\n1 0.5 0.5 0.25 0.2\n\n0 0.5 0.5 0.25 0.2 \r\n0 .5 .5 .2 .2");
  EXPECT_EQ(annotation.boxes.size(), 3u);
  EXPECT_THAT(annotation.left_out,
              ElementsAre("expected each line once, got it again, in a.txt:4"));
  EXPECT_THAT(annotation.left_out_at, ElementsAre(2u));
}

TEST(YoloText, WhatProgramsPutAroundNumbersIsPassedOver) {
  const std::string text =
      "\xEF\xBB\xBF"
      "1.0 0.5 0.5 0.25 0.2\n1e0 0.5 0.5 0.25 0.2\n";
  const Annotation annotation = read_yolo(text);
  ASSERT_EQ(annotation.boxes.size(), 2u);
  EXPECT_EQ(annotation.boxes[0].class_id, 1);
  EXPECT_EQ(annotation.boxes[1].class_id, 1);
  EXPECT_EQ(annotation.original, text);
  EXPECT_THAT(parse_yolo_classes("\xEF\xBB\xBF"
                                 "car\n",
                                 "c")
                  .names.class_names,
              ElementsAre("car"));
}

TEST(YoloText, AnythingElseIsAFaultOfItsLine) {
  EXPECT_EQ(fault_of("0 0.5 0.5 0.1 0.1\n2 0.5 0.5 0.1 0.1"),
            "expected a class 0..1, since there are 2 names, got '2', in a.txt:2");
  EXPECT_EQ(fault_of("-1 0.5 0.5 0.1 0.1"),
            "expected a class 0..1, since there are 2 names, got '-1', in a.txt:1");
  EXPECT_EQ(fault_of("0.5 0.5 0.5 0.1 0.1"),
            "expected a class 0..1, since there are 2 names, got '0.5', in a.txt:1");
  EXPECT_EQ(fault_of("1e30 0.5 0.5 0.1 0.1"),
            "expected a class 0..1, since there are 2 names, got '1e30', in a.txt:1");
  EXPECT_EQ(fault_of("0 1.1 0.5 0.1 0.1"), "expected a share 0..1, got '1.1', in a.txt:1");
  EXPECT_EQ(fault_of("0 0.5 0.5 -0.1 0.1"), "expected a share 0..1, got '-0.1', in a.txt:1");
  EXPECT_EQ(fault_of("0 nan 0.5 0.1 0.1"), "expected a number, got 'nan', in a.txt:1");
  EXPECT_EQ(fault_of("0 0.5 0,5 0.1 0.1"), "expected a number, got '0,5', in a.txt:1");
  EXPECT_EQ(fault_of("0 1e999 0.5 0.1 0.1"), "expected a number, got '1e999', in a.txt:1");
  EXPECT_EQ(fault_of("0 0.5 0.5 0.1"), "expected 5 columns, got 4, in a.txt:1");
  EXPECT_EQ(fault_of("0 0.5 0.5 0.1 0.1 0.9"), "expected 5 columns, got 6, in a.txt:1");
  EXPECT_EQ(fault_of("0 0.1 0.1 0.2 0.1 0.2 0.2 0.3"),
            "expected 5 columns, or kpt_shape in data.yaml, got 8, in a.txt:1");
  EXPECT_THAT(fault_of(std::string("0 0.5 0.5 0.1 0.1\0", 18)), HasSubstr("expected"));
}

TEST(YoloText, PoseLinesHaveJoints) {
  const YoloSchema schema =
      parse_yolo_yaml("names: [person]\nkpt_shape: [3, 3]\nkpt_names: [a, b, c]", "data.yaml");
  EXPECT_THAT(schema.names.joint_names, ElementsAre("a", "b", "c"));
  const auto read = parse_yolo_text(
      "0 0.5 0.5 1 1 0.25 0.5 2 0 0 0 1 0.2 1.000000\n0 0.5 0.5 1 1 0 0 0 0 0 0 0 0 0", schema,
      kYoloImage, "a.txt");
  ASSERT_FALSE(is_fault(read)) << read.fault().reason;
  const Annotation& annotation = *read;
  EXPECT_EQ(annotation.boxes.size(), 2u);
  ASSERT_EQ(annotation.persons.size(), 1u) << "nothing is annotated of the second";
  EXPECT_THAT(annotation.persons[0].joints,
              ElementsAre(Joint{{9.5, 14.5}, 1}, Joint{kMissingPoint, 0}, Joint{{39.5, 5.5}, 0}));
  EXPECT_EQ(annotation.persons[0].box, (Rectangle{0, 0, 40, 30}));
  EXPECT_EQ(fault_of("0 0.5 0.5 1 1", schema), "expected 14 columns, got 5, in a.txt:1");
  EXPECT_EQ(fault_of("0 0.5 0.5 1 1 0.25 0.5 3 0 0 0 1 0.2 1", schema),
            "expected a visibility 0, 1 or 2, got '3', in a.txt:1");
  EXPECT_EQ(fault_of("0 0.5 0.5 1 1 0.25 1.5 1 0 0 0 1 0.2 1", schema),
            "expected a share 0..1, got '1.5', in a.txt:1");
}

TEST(YoloText, JointsWithoutVisibility) {
  const YoloSchema schema = parse_yolo_yaml("names: {0: person}\nkpt_shape: [2, 2]\n", "data.yaml");
  EXPECT_THAT(schema.names.joint_names, ElementsAre("0", "1"));
  const auto read = parse_yolo_text("0 0.5 0.5 1 1 0.25 0.5 0 0", schema, kYoloImage, "a.txt");
  ASSERT_FALSE(is_fault(read));
  EXPECT_THAT(read->persons.at(0).joints,
              ElementsAre(Joint{{9.5, 14.5}, -1}, Joint{kMissingPoint, 0}));
}

TEST(YoloYaml, NamesAreAListOrAMap) {
  EXPECT_THAT(parse_yolo_yaml("names: [a, 'b c', 3]\nnc: 3\ntrain: x", "y").names.class_names,
              ElementsAre("a", "b c", "3"));
  EXPECT_THAT(parse_yolo_yaml("names:\n  1: b\n  0: a\n", "y").names.class_names,
              ElementsAre("a", "b"));
  const YoloSchema pose = parse_yolo_yaml("names: [person]\nkpt_shape: [17, 3]", "y");
  EXPECT_EQ(pose.names.joint_names.size(), 17u);
  EXPECT_EQ(pose.names.joint_names[16], "right_ankle");
  EXPECT_TRUE(pose.has_visibility);
  EXPECT_THAT(parse_yolo_yaml("names: [x]\nkpt_shape: [2, 3]\nkpt_names: {0: [l, r]}", "y")
                  .names.joint_names,
              ElementsAre("l", "r"));
}

TEST(YoloYaml, AnythingElseIsRefused) {
  const auto refused = [](const std::string& text, const std::string& why) {
    EXPECT_THAT([&] { parse_yolo_yaml(text, "data.yaml"); },
                ThrowsMessage<InputError>(HasSubstr(why)))
        << text;
  };
  refused("", "expected keys and values, got something else, in data.yaml");
  refused("a: 1", "expected names, got none, in data.yaml");
  refused("names: x", "expected a list of names, or a map of them, as names, got none");
  refused("names: []", "expected a list of names");
  refused("names: [a, a]", "expected each name once in names, got \"a\" twice");
  refused("names: [a, [b]]", "expected a name each in names");
  refused("names: [a, '']", "expected a name each in names");
  refused("names: {1: a, 2: b}", "expected the numbers 0..1 in names");
  refused("names: {0: a, 0: b}", "expected each number once in names, got 0 twice");
  refused("names: {x: a}", "expected a whole number as names, got x");
  refused("names: [a]\nnames: [b]", "expected names once, got it twice");
  refused("names: [a]\nnc: 2", "expected nc: 1, as many as names, got 2");
  refused("names: [a]\nkpt_shape: 17", "expected kpt_shape: [J, 2 or 3]");
  refused("names: [a]\nkpt_shape: [17, 4]", "got [17, 4]");
  refused("names: [a]\nkpt_shape: [100000000, 3]", "got [100000000, 3]");
  refused("names: [a]\nkpt_shape: [2, 3]\nkpt_names: [l]", "expected kpt_names of 2 joints, got 1");
  std::string aliased = "names: [a]\nl: &l [j0";  // 1,001 lists of 1,000 names in 20 kB
  for (int i = 1; i < 1000; ++i) aliased += ",j" + std::to_string(i);
  aliased += "]\nkpt_shape: [1000, 3]\nkpt_names:\n";
  for (int i = 0; i <= 1000; ++i) aliased += " " + std::to_string(i) + ": *l\n";
  refused(aliased, "expected at most 1,000,000 names in kpt_names, got more, in data.yaml");
  refused("names: [a", "expected YAML");
  refused("names: \"\\x1b[2J", "expected YAML");
  refused(std::string(2000, '['), "expected YAML");
  refused(std::string((1 << 20) + 1, ' '), "expected at most 1 MiB");
}

TEST(YoloClasses, ANameALine) {
  EXPECT_THAT(parse_yolo_classes("a b\r\n c\n\n", "c").names.class_names, ElementsAre("a b", "c"));
  for (const char* text : {"", "\n", "a\n\nb", "a\na"}) {
    EXPECT_THROW(parse_yolo_classes(text, "classes.txt"), InputError) << text;
  }
}

/// Images and texts in a folder.
class YoloLabels : public ::testing::Test {
 protected:
  void image(const std::string& name) { testing::write_flat_image(folder_ / name, kYoloImage, 9); }
  void text(const std::string& name, const std::string& content = "0 0.5 0.5 0.5 0.5") {
    testing::write_file(folder_ / name, content);
  }
  /// As a manifest in that folder would.
  std::unique_ptr<Dataset> open(const std::string& root, const std::string& path,
                                const std::string& manifest = "") const {
    SourceSpec spec;
    spec.root = root;
    spec.labels = LabelSpec{LabelFormat::kYolo, path};
    return open_frames_dataset(spec, folder_ / manifest);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(YoloLabels, LieWhereTheirPathsSay) {
  const struct {
    const char *root, *path, *image, *text;
  } cases[] = {
      {"data/images", "data", "data/images/7.png", "data/labels/7.txt"},
      {"data/images", "data/labels", "data/images/7.png", "data/labels/7.txt"},
      {"data/images/", "data/", "data/images/train/7.png", "data/labels/train/7.txt"},
      {"data/images/train", "data", "data/images/train/7.png", "data/labels/train/7.txt"},
      {"data", "data", "data/7.png", "data/7.txt"},
      {"data", "texts", "data/train/7.png", "texts/train/7.txt"},
      {"data/photos", "data", "data/photos/7.png", "data/labels/7.txt"},
      {"data/images", "texts", "data/images/7.png", "texts/7.txt"},
  };
  for (const auto& layout : cases) {
    std::filesystem::remove_all(folder_ / "data");
    std::filesystem::remove_all(folder_ / "texts");
    image(layout.image);
    text(layout.text);
    text(std::string(layout.path) + "/data.yaml", "names: [cat]");
    const auto dataset = open(layout.root, layout.path);
    ASSERT_EQ(dataset->labelled_frames().size(), 1u) << layout.text;
    const LabelledFrame& frame = dataset->labelled_frames()[0];
    EXPECT_EQ(dataset->paired_frame(frame, 0).state, PairedFrame::State::kPresent) << layout.text;
    EXPECT_EQ(dataset->label_place(frame.label_key), layout.text);
    const auto read = dataset->annotation(frame.label_key);
    ASSERT_FALSE(is_fault(read)) << read.fault().reason;
    EXPECT_EQ(read->boxes.at(0).xyxy, (Rectangle{10, 7.5, 30, 22.5}));
    EXPECT_THAT(dataset->annotation_files(), ::testing::Contains(layout.text));
    EXPECT_THAT(dataset->annotation_files(), ::testing::SizeIs(2));
  }
}

TEST_F(YoloLabels, WhatIsOnOneSideAloneIsNotLost) {
  for (const char* name : {"d/images/1.png", "d/images/2.png", "d/images/3.png"}) image(name);
  text("d/labels/1.txt");
  text("d/labels/2.txt", "");
  text("d/labels/5.txt");
  text("d/labels/old/9.txt");
  text("d/labels/classes.txt", "cat");
  const auto dataset = open("d/images", "d/labels");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("cat"));
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[1].sample_id, "2");
  EXPECT_THAT(dataset->annotation(frames[1].label_key)->boxes, IsEmpty());
  EXPECT_EQ(frames[2].sample_id, "5");
  const PairedFrame missing = dataset->paired_frame(frames[2], 0);
  EXPECT_EQ(missing.state, PairedFrame::State::kMissing);
  EXPECT_EQ(missing.frame.path, "d/images/5.png");
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 folder of labels without images left out in d/labels: old",
                          "no label for 1 of 3 frames in d/labels: no samples of their own"));
}

TEST_F(YoloLabels, ClassesAreInTheFolderAboveWhateverThePathIs) {
  image("d/images/1.png");
  text("d/labels/1.txt");
  text("d/labels/deep/x", "");
  text("d/data.yaml", "names: [cat]");
  const struct {
    const char *manifest, *root, *path, *classes;
  } cases[] = {
      {"d/labels", "../images", ".", "./../data.yaml"},
      {"d/labels", "../images", "./", "./../data.yaml"},
      {"d/labels", "../images", "deep/..", "deep/../../data.yaml"},
      {"d/labels/deep", "../../images", "..", "../../data.yaml"},
      {"d/images", "", "../labels", "../data.yaml"},
      {"d", "images", "labels", "data.yaml"},
  };
  for (const auto& layout : cases) {
    const auto dataset = open(layout.root, layout.path, layout.manifest);
    EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("cat")) << layout.path;
    EXPECT_EQ(dataset->labelled_frames().size(), 1u) << layout.path;
    EXPECT_THAT(dataset->annotation_files(), ::testing::Contains(layout.classes)) << layout.path;
    EXPECT_TRUE(std::filesystem::exists(folder_ / layout.manifest / layout.classes));
  }
}

TEST_F(YoloLabels, JointsWithoutKptShapeAreNotTakenForCorners) {
  image("d/images/1.png");
  image("d/images/2.png");
  text("d/classes.txt", "plate");
  const struct {
    std::string first, second, why;  // "": outlines
  } cases[] = {
      // 4 joints of x y v; 2 joints of x y or an outline; one of a joint where 0 0 is none.
      {"0 .5 .5 .3 .4 .35 .3 2 .65 .3 2 .65 .7 1 .35 .7 2",
       "0 .4 .5 .2 .2 .3 .4 2 .5 .4 2 0 0 0 .3 .6 2",
       "expected kpt_shape: [4, 3] of boxes with 4 joints of x y v, or kpt_shape: [0, 0] of "
       "outlines with 8 corners, since 2 lines of 17 columns may be either, got no kpt_shape in a "
       "data.yaml, in d/labels"},
      {"0 .5 .5 .2 .3 .45 .4 .55 .6", "0 .5 .4 .2 .3 .45 .3 0 0",
       "expected kpt_shape: [2, 2] of boxes with 2 joints of x y, or kpt_shape: [0, 0] of outlines "
       "with 4 corners, since 2 lines of 9 columns may be either"},
      {"0 .5 .5 .2 .3 .45 .4 2", "",
       "expected kpt_shape: [1, 3] of boxes with 1 joint of x y v, since 1 line of 8 columns"},
      // As many corners, and right or left of where centre and size would be a box around them.
      {"0 .7 .7 .8 .7 .8 .8 .7 .8", "0 .8 .1 .9 .1 .9 .2 .8 .2", ""},
      {"0 .5 .5 .05 .05 .5 .1 .9 .9", "0 .5 .5 .1 .1 .1 .5 .4 .9", ""},
      // Other numbers of corners, and more boxes than outlines.
      {"0 .5 .5 .2 .3 .45 .4 .55 .6", "0 .5 .5 .2 .3 .45 .4", ""},
      {"0 .5 .5 .2 .3 .45 .4 .55 .6", "0 .5 .5 .2 .3", ""},
  };
  for (const auto& [first, second, why] : cases) {
    SCOPED_TRACE(first);
    text("d/labels/1.txt", first);
    text("d/labels/2.txt", second);
    const auto open_it = [&] { return open("d/images", "d/labels"); };
    if (why.empty()) {
      const auto read = open_it()->annotation("1.txt");
      ASSERT_FALSE(is_fault(read)) << read.fault().reason;
      EXPECT_FALSE(read->boxes.at(0).outline.empty());
      continue;
    }
    EXPECT_THAT([&] { open_it(); }, ThrowsMessage<InputError>(HasSubstr(why)));
  }
  text("d/labels/1.txt", cases[1].first);
  text("d/labels/2.txt", cases[1].second);
  text("d/data.yaml", "names: [plate]\nkpt_shape: [2, 2]");
  EXPECT_EQ(open("d/images", "d/labels")->annotation("1.txt")->boxes.at(0).xyxy,
            (Rectangle{16, 10.5, 24, 19.5}));
  text("d/data.yaml", "names: [plate]\nkpt_shape: [0, 0]");
  EXPECT_EQ(open("d/images", "d/labels")->annotation("1.txt")->boxes.at(0).xyxy,
            (Rectangle{8, 9, 22, 18}));
}

TEST_F(YoloLabels, WithoutTheClassesNamesTheseAreTheirNumbers) {
  image("d/images/1.png");
  text("d/labels/1.txt", "");
  EXPECT_THAT([&] { open("d/images", "d/labels"); },
              ThrowsMessage<InputError>(HasSubstr(
                  "expected data.yaml or classes.txt with the classes' names, or boxes, got "
                  "neither, in d/labels and the folder above it")));
  text("d/labels/1.txt", "-1e300 0.5 0.5 0.25 0.5\n1e300 0.5 0.5 0.25 0.5\n");
  EXPECT_THROW(open("d/images", "d/labels"), InputError) << "no class's number";
  text("d/labels/1.txt", "2 0.5 0.5 0.25 0.5\n0 0.5 0.5 0.25 0.5\n");
  const auto numbered = open("d/images", "d/labels");
  EXPECT_THAT(numbered->label_schema().class_names, ElementsAre("0", "1", "2"));
  EXPECT_THAT(numbered->notes(),
              ElementsAre("classes are named by their numbers, 0..2, since no data.yaml or "
                          "classes.txt with names is in d/labels or the folder above it"));
  EXPECT_EQ(numbered->annotation("1.txt")->boxes.at(0).class_id, 2);
  for (const char* name : {"d/classes.txt", "d/obj.names", "d/_darknet.labels"}) {
    text(name, "cat\ndog\nbird\n");
    EXPECT_THAT(open("d/images", "d/labels")->label_schema().class_names,
                ElementsAre("cat", "dog", "bird"));
    std::filesystem::remove(folder_ / name);
  }
  text("d/street.yaml", "train: images\nnames: [cat, dog, bird]\n");
  EXPECT_THAT(open("d/images", "d/labels")->label_schema().class_names,
              ElementsAre("cat", "dog", "bird"));
  EXPECT_THAT([&] { open("d/images", "nowhere"); },
              ThrowsMessage<InputError>(HasSubstr("expected a folder")));
}

}  // namespace
}  // namespace eventgan
