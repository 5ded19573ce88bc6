

#include "stages/frames/own_labels/yolo_text.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

constexpr ImageSize kYoloImage{30, 40};

YoloSchema classes() { return parse_yolo_classes("cat\ndog\n", "classes.txt"); }

Outcome<Annotation> parse_yolo(const std::string& text, const YoloSchema& schema = classes()) {
  return parse_yolo_text(text, schema, kYoloImage, "a.txt");
}

Annotation read_yolo(const std::string& text, const YoloSchema& schema = classes()) {
  const auto read = parse_yolo(text, schema);
  EXPECT_EQ(fault_of(read), "no fault");
  return is_fault(read) ? Annotation() : *read;
}

TEST(YoloText, ABoxIsCentreAndSizeAsShares) {
  const std::string text = "1 0.5 0.5 0.25 0.2\r\n\n0 0 1 0.5 1";
  EXPECT_EQ(read_yolo(text), (Annotation{text,
                                         {Box{.class_id = 1, .xyxy = {15, 12, 25, 18}},
                                          Box{.class_id = 0, .xyxy = {-10, 15, 10, 45}}},
                                         {}}));
  EXPECT_EQ(fault_of(parse_yolo("")), "no fault");
}

// Of 40 x 30: 1.01 is 40.4 and 30.3, -0.01 is -0.4 and -0.3.
TEST(YoloText, ASharesRoundingReachesBeyondTheImage) {
  EXPECT_THAT(rectangles(read_yolo("0 0.5 0.5 1.01 0.5\n0 -0.01 1.01 0.5 0.5")),
              ElementsAre(Rectangle{20 - 20.2, 7.5, 20 + 20.2, 22.5},
                          Rectangle{-0.4 - 10, 30.3 - 7.5, -0.4 + 10, 30.3 + 7.5}));
}

TEST(YoloText, AnOutlineIsTheBoxAroundIt) {
  const Annotation annotation =
      read_yolo("1 0.25 0.3 0.5 0.2 0.125 0.4 0.2 0.4\n0 0.5 0.5 0.25 0.2\n0 0 0 1.005 0 1 1");
  EXPECT_EQ(annotation.boxes.at(0).class_id, 1);
  EXPECT_THAT(rectangles(annotation),
              ElementsAre(Rectangle{5, 6, 20, 12}, Rectangle{15, 12, 25, 18},
                          Rectangle{0, 0, 1.005 * 40, 30}));
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
                  AllOf(HasSubstr("expected a box within the image of 40x30, got one from (40."),
                        EndsWith(", in a.txt:3"))));
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
  const std::string mark = "\xEF\xBB\xBF";
  const std::string text = mark + "1.0 0.5 0.5 0.25 0.2\n1e0 0.5 0.5 0.25 0.2\n";
  const Annotation annotation = read_yolo(text);
  EXPECT_THAT(annotation.boxes, ElementsAre(Field(&Box::class_id, 1), Field(&Box::class_id, 1)));
  EXPECT_EQ(annotation.original, text);
  EXPECT_THAT(parse_yolo_classes(mark + "car\n", "c").names.class_names, ElementsAre("car"));
}

TEST(YoloText, AnythingElseIsAFaultOfItsLine) {
  for (const std::string number : {"2", "-1", "0.5", "1e30"}) {
    EXPECT_EQ(fault_of(parse_yolo("0 0.5 0.5 0.1 0.1\n" + number + " 0.5 0.5 0.1 0.1")),
              "expected a class 0..1, since there are 2 names, got '" + number + "', in a.txt:2");
  }
  const std::pair<const char*, const char*> cases[] = {
      {"0 1.1 0.5 0.1 0.1", "expected a share 0..1, got '1.1'"},
      {"0 0.5 0.5 -0.1 0.1", "expected a share 0..1, got '-0.1'"},
      {"0 0.5 0.5 1.0101 0.5", "expected a share 0..1, got '1.0101'"},
      {"0 -0.0101 0.5 1 0.5", "expected a share 0..1, got '-0.0101'"},
      {"0 0.1 0.2 0.3 0.1 0.1 2", "expected a share 0..1, got '2'"},
      {"0 nan 0.5 0.1 0.1", "expected a number, got 'nan'"},
      {"0 0.5 0,5 0.1 0.1", "expected a number, got '0,5'"},
      {"0 1e999 0.5 0.1 0.1", "expected a number, got '1e999'"},
      {"0 0.1 0.2 0.3 x 0.1 0.2", "expected a number, got 'x'"},
      {"0 0.5 0.5 0.1", "expected 5 columns, got 4"},
      {"0 0.5 0.5 0.1 0.1 0.9", "expected 5 columns, got 6"},
      {"0 0.1 0.1 0.2 0.1 0.2 0.2 0.3", "expected 5 columns, or kpt_shape in data.yaml, got 8"}};
  for (const auto& [text, fault] : cases) {
    EXPECT_EQ(fault_of(parse_yolo(text)), fault + ", in a.txt:1"s) << text;
  }
  EXPECT_THAT(fault_of(parse_yolo("0 0.5 0.5 0.1 0.1\0"s)), HasSubstr("expected"));
}

TEST(YoloText, PoseLinesHaveJoints) {
  const YoloSchema schema =
      parse_yolo_yaml("names: [person]\nkpt_shape: [3, 3]\nkpt_names: [a, b, c]", "data.yaml");
  EXPECT_THAT(schema.names.joint_names, ElementsAre("a", "b", "c"));
  const Annotation annotation = read_yolo(
      "0 0.5 0.5 1 1 0.25 0.5 2 0 0 0 1 0.2 1.000000\n0 0.5 0.5 1 1 0 0 0 0 0 0 0 0 0", schema);
  EXPECT_EQ(annotation.boxes.size(), 2u);
  ASSERT_EQ(annotation.persons.size(), 1u) << "nothing is annotated of the second";
  EXPECT_THAT(annotation.persons[0].joints,
              ElementsAre(Joint{{9.5, 14.5}, 1}, Joint{kMissingPoint, 0}, Joint{{39.5, 5.5}, 0}));
  EXPECT_EQ(annotation.persons[0].box, (Rectangle{0, 0, 40, 30}));
  for (const auto& [more, fault] :
       {std::pair("", "expected 14 columns, got 5, in a.txt:1"),
        {" 0.25 0.5 3 0 0 0 1 0.2 1", "expected a visibility 0, 1 or 2, got '3', in a.txt:1"},
        {" 0.25 1.5 1 0 0 0 1 0.2 1", "expected a share 0..1, got '1.5', in a.txt:1"}}) {
    EXPECT_EQ(fault_of(parse_yolo("0 0.5 0.5 1 1"s + more, schema)), fault);
  }
}

TEST(YoloText, JointsWithoutVisibility) {
  const YoloSchema schema = parse_yolo_yaml("names: {0: person}\nkpt_shape: [2, 2]\n", "data.yaml");
  EXPECT_THAT(schema.names.joint_names, ElementsAre("0", "1"));
  EXPECT_THAT(read_yolo("0 0.5 0.5 1 1 0.25 0.5 0 0", schema).persons.at(0).joints,
              ElementsAre(Joint{{9.5, 14.5}, -1}, Joint{kMissingPoint, 0}));
  // Shares are taken that rounding has put a little beyond 0..1: the image's edges.
  EXPECT_THAT(read_yolo("0 0.5 0.5 1 1 1.005 -0.01 -0.005 1.01", schema).persons.at(0).joints,
              ElementsAre(Joint{{39.5, -0.5}, -1}, Joint{{-0.5, 29.5}, -1}));
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
  for (const auto& [flip, last] :
       {std::pair("[0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15]", "right_ankle"),
        {"[]", "right_ankle"},
        {"", "right_ankle"},
        {"[1, 0, 2, 3, 4, 8, 9, 10, 5, 6, 7, 14, 15, 16, 11, 12, 13]",
         "16"}}) {  // AP-10K's animals
    const YoloSchema schema =
        parse_yolo_yaml("names: [a]\nkpt_shape: [17, 3]\nflip_idx: "s + flip, "y");
    EXPECT_EQ(schema.names.joint_names.at(16), last);
    EXPECT_EQ(schema.are_joints_assumed, last != "16"s);
  }
  EXPECT_THAT(parse_yolo_yaml("names: [x]\nkpt_shape: [2, 3]\nkpt_names: {0: [l, r]}", "y")
                  .names.joint_names,
              ElementsAre("l", "r"));
}

TEST(YoloYaml, AnythingElseIsRefused) {
  std::string aliased = "names: [a]\nl: &l [j0";  // 1,001 lists of 1,000 names in 20 kB
  for (int i = 1; i < 1000; ++i) aliased += ",j" + std::to_string(i);
  aliased += "]\nkpt_shape: [1000, 3]\nkpt_names:\n";
  for (int i = 0; i <= 1000; ++i) aliased += " " + std::to_string(i) + ": *l\n";
  const std::pair<std::string, const char*> cases[] = {
      {"", "expected keys and values, got something else, in data.yaml"},
      {"a: 1", "expected names, got none, in data.yaml"},
      {"names: x", "expected a list of names, or a map of them, as names, got none"},
      {"names: []", "expected a list of names"},
      {"names: [a, a]", "expected each name once in names, got \"a\" twice"},
      {"names: [a, [b]]", "expected a name each in names"},
      {"names: [a, '']", "expected a name each in names"},
      {"names: {1: a, 2: b}", "expected the numbers 0..1 in names"},
      {"names: {0: a, 0: b}", "expected each number once in names, got 0 twice"},
      {"names: {x: a}", "expected a whole number as names, got x"},
      {"names: [a]\nnames: [b]", "expected names once, got it twice"},
      {"names: [a]\nnc: 2", "expected nc: 1, as many as names, got 2"},
      {"names: [a]\nkpt_shape: 17", "expected kpt_shape: [J, 2 or 3]"},
      {"names: [a]\nkpt_shape: [17, 4]", "got [17, 4]"},
      {"names: [a]\nkpt_shape: [100000000, 3]", "got [100000000, 3]"},
      {"names: [a]\nkpt_shape: [2, 3]\nkpt_names: [l]", "expected kpt_names of 2 joints, got 1"},
      {"names: [a]\nkpt_shape: [17, 3]\nflip_idx: no", "expected a list of joints as flip_idx"},
      {aliased, "expected at most 1,000,000 names in kpt_names, got more, in data.yaml"},
      {"names: [a", "expected YAML"},
      {"names: \"\\x1b[2J", "expected YAML"},
      {std::string(2000, '['), "expected YAML"},
      {std::string((1 << 20) + 1, ' '), "expected at most 1 MiB"}};
  for (const auto& [text, why] : cases) {
    EXPECT_THROWS(parse_yolo_yaml(text, "data.yaml"), InputError, why) << text.substr(0, 99);
  }
}

TEST(YoloClasses, ANameALine) {
  EXPECT_THAT(parse_yolo_classes("a b\r\n c\n\n", "c").names.class_names, ElementsAre("a b", "c"));
  for (const char* text : {"", "\n", "a\n\nb", "a\na"}) {
    EXPECT_THROWS(parse_yolo_classes(text, "classes.txt"), InputError, "expected", "classes.txt")
        << text;
  }
}

/// Images and texts in a folder.
class YoloLabels : public FolderTest {
 protected:
  void text(const std::string& name, const std::string& content = "0 0.5 0.5 0.5 0.5") const {
    write(name, content);
  }
  /// As a manifest in that folder would.
  std::unique_ptr<Dataset> open(const std::string& root = "d/images",
                                const std::string& path = "d/labels",
                                const std::string& manifest = "") const {
    SourceSpec spec;
    spec.root = root;
    spec.labels = LabelSpec{LabelFormat::kYolo, path};
    return open_frames_dataset(spec, at(manifest));
  }
  Texts names() const { return open()->label_schema().class_names; }
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
    SCOPED_TRACE(layout.text);
    for (const char* folder : {"data", "texts"}) fs::remove_all(at(folder));
    images({layout.image});
    text(layout.text);
    text(layout.path + "/data.yaml"s, "names: [cat]");
    const auto dataset = open(layout.root, layout.path);
    ASSERT_EQ(dataset->labelled_frames().size(), 1u);
    EXPECT_THAT(paired(*dataset, 0, {0}), ElementsAre(StartsWith("present")));
    EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key), layout.text);
    EXPECT_THAT(rectangles(annotation_of(*dataset)), ElementsAre(Rectangle{10, 7.5, 30, 22.5}));
    EXPECT_THAT(dataset->annotation_files(), AllOf(Contains(layout.text), SizeIs(2)));
  }
}

TEST_F(YoloLabels, WhatIsOnOneSideAloneIsNotLost) {
  images({"d/images/1.png", "d/images/2.png", "d/images/3.png"});
  for (const char* name : {"d/labels/1.txt", "d/labels/5.txt", "d/labels/old/9.txt"}) text(name);
  text("d/labels/2.txt", "");
  text("d/labels/classes.txt", "cat");
  EXPECT_THAT(names(), ElementsAre("cat"));
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("1", "2", "5"));
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, IsEmpty());
  EXPECT_THAT(paired(*dataset, 2, {0}), ElementsAre("missing d/images/5.png -1"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 folder of labels without images left out in d/labels: old",
                          "no label for 1 of 3 frames in d/labels: no samples of their own"));
}

TEST_F(YoloLabels, SecondFilesOfTheSameImagesAreTold) {
  images(
      {"d/images/train/1.png", "d/images/val/1.png", "e/train/images/1.png", "e/val/images/1.png"});
  for (const char* name : {"d/labels/train/1.txt", "d/labels/val/1.txt", "d/labels_old/train/1.txt",
                           "d/calib/train/1.txt", "d/labels/other/1.txt", "e/train/labels/1.txt",
                           "e/val/labels/1.txt", "e/train/calib/1.txt", "e/train/notes/2.txt"}) {
    text(name);
  }
  EXPECT_THAT(open("d/images/train", "d")->notes(),
              Contains("2 folders with more .txt files of these images left out: d/labels/other, "
                       "d/labels_old/train"));
  EXPECT_THAT(open("e/train/images", "e")->notes(), Not(Contains(HasSubstr("left out"))));
  text("e/train/old/1.txt");
  EXPECT_THAT(open("e/train/images", "e/train/labels")->notes(),
              Contains("1 folder with more .txt files of these images left out: e/train/old"));
}

TEST_F(YoloLabels, AnImageMayBeCalledAsAList) {
  images({"d/images/train.png", "d/images/2.png"});
  for (const char* name : {"d/labels/train.txt", "d/labels/2.txt"}) text(name);
  text("d/labels/val.txt", "images/2.png");
  text("d/labels/classes.txt", "cat");
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("2", "train"));
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, SizeIs(1));
}

TEST_F(YoloLabels, ClassesAreInTheFolderAboveWhateverThePathIs) {
  images({"d/images/1.png"});
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
  for (const auto& [manifest, root, path, classes] : cases) {
    SCOPED_TRACE(path);
    const auto dataset = open(root, path, manifest);
    EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("cat"));
    EXPECT_EQ(dataset->labelled_frames().size(), 1u);
    EXPECT_THAT(dataset->annotation_files(), Contains(classes));
    EXPECT_TRUE(fs::exists(at(manifest) / classes));
  }
}

TEST_F(YoloLabels, NamesThatAreOthersElsewhereAreTold) {
  images({"d/images/1.png"});
  text("d/labels/1.txt");
  text("d/data.yaml", "names: [cat, dog]\nkpt_shape: [0, 0]");
  text("d/labels/classes.txt", "dog\ncat");
  const auto warnings = [&](const char* path) { return open("d/images", path)->warnings(); };
  EXPECT_THAT(warnings("d"),
              ElementsAre("class 0 is \"cat\" in d/data.yaml, whose names are taken, "
                          "but \"dog\" in d/labels/classes.txt"));
  EXPECT_THAT(warnings("d/labels"),
              ElementsAre("class 0 is \"dog\" in d/labels/classes.txt, whose names are taken, but "
                          "\"cat\" in d/data.yaml"));
  for (const char* fewer : {"cat", "cat\ndog\ncow", "cat\n\ndog"}) {
    text("d/labels/classes.txt", fewer);
    EXPECT_THAT(warnings("d"), IsEmpty()) << fewer;
  }
  text("d/data.yaml", "names: [person]\nkpt_shape: [17, 3]");
  EXPECT_THAT(open("d/images", "d")->notes(),
              Contains("17 joints have COCO's names, since kpt_names names none, in d/data.yaml"));
}

TEST_F(YoloLabels, JointsWithoutKptShapeAreNotTakenForCorners) {
  images({"d/images/1.png", "d/images/2.png"});
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
  const auto write_both = [&](const auto& one) {
    text("d/labels/1.txt", one.first);
    text("d/labels/2.txt", one.second);
  };
  for (const auto& one : cases) {
    SCOPED_TRACE(one.first);
    write_both(one);
    if (one.why.empty()) {
      EXPECT_FALSE(annotation_of(*open()).boxes.at(0).outline.empty());
    } else {
      EXPECT_THROWS(open(), InputError, one.why);
    }
  }
  write_both(cases[1]);
  for (const auto& [shape, box] :
       {std::pair("[2, 2]", Rectangle{16, 10.5, 24, 19.5}), {"[0, 0]", {8, 9, 22, 18}}}) {
    text("d/data.yaml", "names: [plate]\nkpt_shape: "s + shape);
    EXPECT_EQ(annotation_of(*open()).boxes.at(0).xyxy, box);
  }
}

TEST_F(YoloLabels, WithoutTheClassesNamesTheseAreTheirNumbers) {
  images({"d/images/1.png"});
  text("d/labels/1.txt", "");
  EXPECT_THROWS(open(), InputError,
                "expected data.yaml or classes.txt with the classes' names, or boxes, got "
                "neither, in d/labels and the folder above it");
  text("d/labels/1.txt", "-1e300 0.5 0.5 0.25 0.5\n1e300 0.5 0.5 0.25 0.5\n");
  EXPECT_THROWS(open(), InputError, "expected data.yaml or classes.txt") << "no class's number";
  text("d/labels/1.txt", "2 0.5 0.5 0.25 0.5\n0 0.5 0.5 0.25 0.5\n");
  EXPECT_THAT(names(), ElementsAre("0", "1", "2"));
  EXPECT_THAT(open()->notes(),
              ElementsAre("classes are named by their numbers, 0..2, since no data.yaml or "
                          "classes.txt with names is in d/labels or the folder above it"));
  EXPECT_EQ(annotation_of(*open()).boxes.at(0).class_id, 2);
  for (const auto& [name, content] :
       {std::pair("d/classes.txt", "cat\ndog\nbird\n"),
        {"d/obj.names", "cat\ndog\nbird\n"},
        {"d/_darknet.labels", "cat\ndog\nbird\n"},
        {"d/street.yaml", "train: images\nnames: [cat, dog, bird]\n"}}) {
    text(name, content);
    EXPECT_THAT(names(), ElementsAre("cat", "dog", "bird")) << name;
    fs::remove(at(name));
  }
  EXPECT_THROWS(open("d/images", "nowhere"), InputError, "expected a folder");
}

}  // namespace
}  // namespace eventgan
