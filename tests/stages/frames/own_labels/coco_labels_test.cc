#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "manifests/files/input_file.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

constexpr ImageSize kImage{30, 40};

/// A folder with images, and COCO labels beside it.
class CocoLabels : public ::testing::Test {
 protected:
  CocoLabels() {
    for (const char* name : {"images/000001.png", "images/000002.png", "images/000003.png"}) {
      testing::write_flat_image(folder_ / name, kImage, 7);
    }
  }

  static std::string image(int id, const std::string& name, ImageSize size = kImage) {
    return nlohmann::json{
        {"id", id}, {"file_name", name}, {"width", size.width}, {"height", size.height}}
        .dump();
  }

  static std::string box(int id, int image_id, const std::string& bbox,
                         const std::string& more = "") {
    return "{\"id\": " + std::to_string(id) + ", \"image_id\": " + std::to_string(image_id) +
           ", \"category_id\": 3, \"bbox\": " + bbox + more + "}";
  }

  void write(const std::string& images, const std::string& annotations,
             const std::string& categories = R"({"id": 3, "name": "person"})") {
    testing::write_file(folder_ / "instances.json",
                        "{\"info\": {\"year\": [1, {}]}, \"images\": [" + images +
                            "], \"annotations\": [" + annotations + "], \"categories\": [" +
                            categories + "]}");
  }

  std::unique_ptr<Dataset> open(const std::string& root = "images") const {
    SourceSpec spec;
    spec.root = root;
    spec.labels = LabelSpec{LabelFormat::kCoco, "instances.json"};
    return open_frames_dataset(spec, folder_.path());
  }

  Annotation annotation(const std::string& key) const {
    const auto read = open()->annotation(key);
    return is_fault(read) ? Annotation{read.fault().reason, {}, {}} : *read;
  }

  std::string fault(const std::string& key = "7") const {
    const auto read = open()->annotation(key);
    return is_fault(read) ? read.fault().reason : "no fault";
  }

  void expect_refused(const std::string& why) const {
    EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr(why)));
  }

  testing::TemporaryFolder folder_;
};

TEST_F(CocoLabels, TheFileIsOpenedOnceAndOfEachImageItsEntriesAreReadAgain) {
  const std::string first = image(7, "000001.png"), second = image(9, "000003.png");
  const std::string of_first = box(1, 7, "[1, 2, 3, 4]"), of_second = box(2, 9, "[0, 0, 40, 30]");
  write(first + "," + second, of_first + "," + of_second);
  const InputCounter counter;
  const auto dataset = open();
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    EXPECT_FALSE(is_fault(dataset->annotation(frame.label_key)));
  }
  const InputCounter::Count count = counter.of(folder_ / "instances.json");
  EXPECT_EQ(count.opens, 1u);
  EXPECT_EQ(count.bytes, std::filesystem::file_size(folder_ / "instances.json") + first.size() +
                             second.size() + of_first.size() + of_second.size());
}

TEST_F(CocoLabels, OfTheImagesThatTheyName) {
  // Ids neither sorted nor dense, annotations between each other's, entries with odd spaces.
  write(image(9, "000003.png") + ",\n" + image(7, "000001.png"),
        box(1, 7, "[1, 2, 3.5, 4]", R"(, "iscrowd": 1)") + "," + box(2, 9, "[0,0,40,30]") + ", " +
            box(3, 7, "[ -2, 1e1 , 5,25 ]"));
  const auto dataset = open();
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("person"));
  EXPECT_THAT(dataset->label_schema().joint_names, IsEmpty());
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("instances.json"));
  EXPECT_THAT(dataset->notes(), ElementsAre("no label for 1 of 3 frames in instances.json: no "
                                            "samples of their own"));
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].sample_id, "000001");
  EXPECT_EQ(frames[0].label_key, "7");
  EXPECT_EQ(frames[1].frame.path, "images/000003.png");
  EXPECT_EQ(dataset->label_place("7"), "instances.json#images/7");
  // Frame 2 has no label, and is a paired frame.
  const PairedFrame paired = dataset->paired_frame(frames[1], -1);
  EXPECT_EQ(paired.state, PairedFrame::State::kPresent);
  EXPECT_EQ(paired.frame.path, "images/000002.png");

  const Annotation read = annotation("7");
  ASSERT_EQ(read.boxes.size(), 2u);
  EXPECT_EQ(read.boxes[0].xyxy, (Rectangle{1, 2, 4.5, 6}));
  EXPECT_TRUE(read.boxes[0].ignore);
  EXPECT_EQ(read.boxes[1].xyxy, (Rectangle{-2, 10, 3, 35}));
  EXPECT_FALSE(read.boxes[1].ignore);
  EXPECT_THAT(read.persons, IsEmpty());
  EXPECT_EQ(read.original, "{\"image\": " + image(7, "000001.png") + ", \"annotations\": [" +
                               box(1, 7, "[1, 2, 3.5, 4]", R"(, "iscrowd": 1)") + ", " +
                               box(3, 7, "[ -2, 1e1 , 5,25 ]") + "]}");
  EXPECT_THAT(annotation("9").boxes,
              ElementsAre(::testing::Field(&Box::xyxy, Rectangle{0, 0, 40, 30})));
}

TEST_F(CocoLabels, ClassesAreNumberedByAscendingId) {
  write(image(7, "000001.png"),
        R"({"id": 1, "image_id": 7, "category_id": 90, "bbox": [1, 1, 2, 2]},
           {"id": 2, "image_id": 7, "category_id": 2, "bbox": [1, 1, 2, 2]})",
        R"({"id": 90, "name": "b"}, {"id": 2, "name": "c"}, {"id": 5, "name": "a"})");
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("c", "a", "b"));
  EXPECT_EQ(annotation("7").boxes.at(0).class_id, 2);
  EXPECT_EQ(annotation("7").boxes.at(1).class_id, 0);
}

TEST_F(CocoLabels, ACategoryThatNoneHasIsNoClassBesideItsNamesake) {
  // Roboflow's root: in a split with annotations, and in one without any.
  const char* categories = R"({"id": 0, "name": "fish"}, {"id": 1, "name": "fish"},
                              {"id": 2, "name": "crab"})";
  write(image(7, "000001.png"), R"({"id": 1, "image_id": 7, "category_id": 1,
                                    "bbox": [1, 1, 2, 2]})",
        categories);
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("fish", "crab"));
  EXPECT_EQ(annotation("7").boxes.at(0).class_id, 0);
  write(image(7, "000001.png"), "", categories);
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("fish", "crab"));
  write(image(7, "000001.png"), R"({"id": 1, "image_id": 7, "category_id": 0,
                                    "bbox": [1, 1, 2, 2]})",
        categories);
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("fish", "crab"));
  EXPECT_EQ(annotation("7").boxes.at(0).class_id, 0);
}

TEST_F(CocoLabels, KeypointsAreMeasuredFromTheImagesEdge) {
  const std::string person =
      R"({"id": 3, "name": "person", "keypoints": ["nose", "eye", "ear"], "skeleton": [[1, 2]]})";
  write(image(7, "000001.png"),
        box(1, 7, "[1, 2, 30, 20]",
            R"(, "num_keypoints": 2, "keypoints": [10, 12, 2, 0, 0, 0, 11.5, 13, 1])") +
            "," +
            box(2, 7, "[1, 2, 3, 4]", R"(, "num_keypoints": 0, "keypoints": [0,0,0,0,0,0,0,0,0])"),
        person);
  EXPECT_THAT(open()->label_schema().joint_names, ElementsAre("nose", "eye", "ear"));
  const Annotation read = annotation("7");
  EXPECT_EQ(read.boxes.size(), 2u);
  ASSERT_EQ(read.persons.size(), 1u) << "nothing is annotated of the second";
  EXPECT_EQ(read.persons[0].box, (Rectangle{1, 2, 31, 22}));
  EXPECT_THAT(read.persons[0].joints,
              ElementsAre(Joint{{9.5, 11.5}, 1}, Joint{kMissingPoint, 0}, Joint{{11, 12.5}, 0}));
  const auto with = [&](const std::string& keypoints) {
    write(image(7, "000001.png"), box(1, 7, "[1, 2, 30, 20]", ", \"keypoints\": " + keypoints),
          person);
    return fault();
  };
  EXPECT_THAT(with("[1, 2, 2]"),
              AllOf(HasSubstr("instances.json (annotation 1): $.keypoints: expected x, y, v of "
                              "each of 3 joints, got an array of 3")));
  EXPECT_THAT(with("[1, 2, 3, 0, 0, 0, 0, 0, 0]"), HasSubstr("$.keypoints[2]: expected"));
  // Whole numbers as 2.0, and a count of joints that counts otherwise.
  write(image(7, "000001.png"),
        box(1, 7, "[1, 2, 30, 20]",
            R"(, "keypoints": [1.0, 2.5, 2.0, 0, 0, 0, 0, 0, 0.0], "num_keypoints": 2)"),
        person);
  EXPECT_EQ(annotation("7").persons.at(0).joints.at(0), (Joint{{0.5, 2}, 1}));
  write(image(7, "000001.png"), "",
        person + R"(, {"id": 4, "name": "dog", "keypoints": ["nose", "tail"]})");
  expect_refused("expected one list of keypoints, got two, of \"dog\" another, in instances.json");
}

TEST_F(CocoLabels, JointsWithoutNamesAreNumberedIfAllAreAsMany) {
  const auto with = [&](const std::string& first, const std::string& second,
                        const std::string& categories) {
    write(image(7, "000001.png"),
          box(1, 7, "[1, 2, 30, 20]", ", \"keypoints\": " + first) + "," +
              box(2, 7, "[1, 2, 30, 20]", ", \"keypoints\": " + second),
          categories);
    return open();
  };
  const std::string face = R"({"id": 3, "name": "face", "keypoints": []})";
  for (const std::string& category : {face, std::string(R"({"id": 3, "name": "face"})")}) {
    EXPECT_THAT(with("[10, 12, 2, 11.5, 13, 1]", "[]", category)->label_schema().joint_names,
                ElementsAre("0", "1"));
    ASSERT_EQ(annotation("7").persons.size(), 1u);
    EXPECT_THAT(annotation("7").persons[0].joints,
                ElementsAre(Joint{{9.5, 11.5}, 1}, Joint{{11, 12.5}, 0}));
  }
  EXPECT_THAT(with("[0, 0, 0]", "[]", face)->label_schema().joint_names, IsEmpty());
  const char* note =
      "keypoints of 2 annotations left out, since their category names none and they differ in "
      "number, in instances.json";
  const auto differing = with("[1, 2, 2]", "[1, 2, 2, 3, 4, 2]", face);
  EXPECT_THAT(differing->notes(), Contains(note));
  EXPECT_THAT(differing->label_schema().joint_names, IsEmpty());
  EXPECT_EQ(annotation("7").boxes.size(), 2u);
  EXPECT_THAT(annotation("7").persons, IsEmpty());
  // Beside a category that names one joint.
  const auto beside = with("[1, 2, 2, 3, 4, 2]", "[1, 2, 2, 3, 4, 2]",
                           face + R"(, {"id": 4, "name": "dog", "keypoints": ["nose"]})");
  EXPECT_THAT(beside->notes(), Contains(note));
  EXPECT_THAT(beside->label_schema().joint_names, ElementsAre("nose"));
}

TEST_F(CocoLabels, WholeBodysFeetFaceAndHandsAreJoints) {
  const auto list = [](int joints, const std::string& first) {
    std::string text = first;
    for (int i = 1; i < joints; ++i) text += ", 0, 0, 0";
    return "[" + text + "]";
  };
  const std::string parts = R"(, "foot_kpts": )" + list(6, "1, 2, 2") + R"(, "face_kpts": )" +
                            list(68, "3, 4, 0.5") + R"(, "lefthand_kpts": )" + list(21, "5, 6, 1") +
                            R"(, "righthand_kpts": )" + list(21, "7, 8, 2") +
                            R"(, "righthand_valid": false)";
  const std::string person = R"({"id": 3, "name": "person", "keypoints": ["nose", "eye"]})";
  write(image(7, "000001.png"),
        box(1, 7, "[1, 2, 30, 20]", R"(, "keypoints": [10, 12, 2, 0, 0, 0])" + parts) + "," +
            box(2, 7, "[1, 2, 30, 20]", R"(, "keypoints": [10, 12, 2, 0, 0, 0])"),
        person);
  const std::vector<std::string> names = open()->label_schema().joint_names;
  ASSERT_EQ(names.size(), 2u + 116u);
  EXPECT_EQ(names[2], "left_big_toe");
  // MMPose swaps face-0 and face-16, face-36 and face-45, face-41 and face-46; 8 is the chin.
  for (const auto& [i, name] : {std::pair(0, "right_face_0"),
                                {16, "left_face_0"},
                                {8, "face_8"},
                                {36, "right_face_36"},
                                {45, "left_face_36"},
                                {46, "left_face_41"},
                                {30, "face_30"},
                                {67, "left_face_65"}}) {
    EXPECT_EQ(names[static_cast<std::size_t>(8 + i)], name);
  }
  EXPECT_EQ(names[8 + 68], "left_hand_0");
  EXPECT_EQ(names.back(), "right_hand_20");
  const Annotation read = annotation("7");
  ASSERT_EQ(read.persons.size(), 2u) << read.original;
  const std::vector<Joint>& joints = read.persons[0].joints;
  ASSERT_EQ(joints.size(), names.size());
  EXPECT_EQ(joints[0], (Joint{{9.5, 11.5}, 1}));
  EXPECT_EQ(joints[2], (Joint{{0.5, 1.5}, 1}));
  EXPECT_EQ(joints[8], (Joint{{2.5, 3.5}, -1})) << "a share of certainty";
  EXPECT_EQ(joints[8 + 68], (Joint{{4.5, 5.5}, 0}));
  EXPECT_EQ(joints[8 + 68 + 21], (Joint{kMissingPoint, 0})) << "it is not valid";
  EXPECT_EQ(read.persons[1].joints.size(), names.size());
  write(image(7, "000001.png"), box(1, 7, "[1, 2, 30, 20]", R"(, "face_kpts": [1, 2, 2])"), person);
  EXPECT_THAT(fault(), HasSubstr("$.face_kpts: expected x, y, v of each of 68 joints"));
}

TEST_F(CocoLabels, PoseTracksUnlabelledFramesAreNoneAndItsRegionsAreIgnored) {
  const std::string rest = R"(, "width": 40, "height": 30, "is_labeled": )";
  const std::string regions = R"(, "ignore_regions_x": [[10, 20, 20, 10], [1, 2, 3]],
                                  "ignore_regions_y": [[5, 5, 9, 9], [4, 4, 4]])";
  const std::string labelled = R"({"id": 7, "file_name": "000001.png")" + rest + "true";
  const std::string persons = R"({"id": 1, "name": "hat"},
                                 {"id": 3, "name": "person", "keypoints": ["nose"]})";
  const std::string one =
      box(1, 7, "[1, 2, 30, 20]",
          R"(, "keypoints": [9, 8, 2], "bbox_head": [3, 4, 5, 6], "track_id": 2)");
  write(labelled + regions + "}," + R"({"id": 8, "file_name": "000002.png")" + rest + "false}", one,
        persons);
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_THAT(dataset->notes(), Contains(HasSubstr("no label for 2 of 3 frames")));
  const Annotation read = annotation("7");
  ASSERT_EQ(read.boxes.size(), 2u) << read.original;
  EXPECT_FALSE(read.boxes[0].ignore);
  EXPECT_EQ(read.boxes[1].class_id, 1);
  EXPECT_TRUE(read.boxes[1].ignore);
  EXPECT_EQ(read.boxes[1].xyxy, (Rectangle{10, 5, 20, 9}));
  EXPECT_THAT(read.left_out, ElementsAre(HasSubstr("got 0 x 0, in instances.json#images/7")));
  EXPECT_EQ(read.persons.at(0).head_box, (Rectangle{3, 4, 8, 10}));
  // What has objects is labelled, whatever is said of it.
  write(R"({"id": 7, "file_name": "000001.png")" + rest + "false}", one, persons);
  EXPECT_EQ(open()->labelled_frames().size(), 1u);
  write(labelled + R"(, "ignore_regions_x": [[1]], "ignore_regions_y": [[1, 2]]})", one, persons);
  EXPECT_THAT(fault(), HasSubstr("$.ignore_regions_y: expected as many numbers as"));
}

TEST_F(CocoLabels, ABoxOutsideTheImageOrWithoutAreaIsLeftOut) {
  const auto left_out = [&](const std::string& bbox, const std::string& more = "") {
    write(image(7, "000001.png"), box(17, 7, bbox, more) + "," + box(18, 7, "[1, 2, 3, 4]"));
    const Annotation read = annotation("7");
    EXPECT_EQ(read.boxes.size(), 1u);
    return read.left_out.empty() ? "none" : read.left_out.at(0);
  };
  EXPECT_EQ(left_out("[40, 2, 3, 4]"),
            "expected a box within the image of 40x30, got one from (40, 2) to (43, 6), in "
            "instances.json (annotation 17)");
  EXPECT_EQ(left_out("[4, 2, 0, 4]", R"(, "iscrowd": 1)"),
            "expected a box of a width and height above 0, got 0 x 4, in instances.json "
            "(annotation 17)");
  EXPECT_THAT(left_out("[4, 2, 3.5, 0]"), HasSubstr("got 3.5 x 0, in"));
}

TEST_F(CocoLabels, WhatNoLabelComesOfDoesNotMatter) {
  write(R"({"id": 7.0, "file_name": "000001.png", "width": 40.0, "height": 3e1})",
        R"({"id": 1, "image_id": 7.0, "category_id": 3.0, "bbox": [1, 2, 3, 4], "area": null,
            "iscrowd": null, "keypoints": null})",
        R"({"id": 0, "name": "person", "supercategory": "none"}, {"id": 3, "name": "person"})");
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("person"));
  EXPECT_EQ(annotation("7").boxes.at(0).xyxy, (Rectangle{1, 2, 4, 6}));
  EXPECT_EQ(annotation("7").boxes.at(0).class_id, 0);
}

TEST_F(CocoLabels, CornersInPlaceOfSidesAreAWarning) {
  const auto warnings = [&](const std::vector<std::string>& boxes) {
    std::string annotations;
    for (const std::string& bbox : boxes) annotations += (annotations.empty() ? "" : ",") + bbox;
    write(image(7, "000001.png"), annotations);
    return open()->warnings();
  };
  const std::string beyond = box(1, 7, "[20, 10, 30, 25]"), within = box(2, 7, "[20, 10, 10, 15]");
  EXPECT_THAT(warnings({beyond, beyond, within}),
              ElementsAre(HasSubstr("2 of 3 compared boxes reach beyond their image: \"bbox\"")));
  EXPECT_THAT(warnings({beyond, beyond, within, within}), IsEmpty());
  EXPECT_THAT(warnings({beyond, beyond}), IsEmpty()) << "too few to tell";
}

TEST_F(CocoLabels, ImagesMayBeNamedAsToolsWriteThem) {
  const auto key_of = [&](const std::string& name) {
    write(image(7, name), "");
    const auto dataset = open();
    EXPECT_THAT(dataset->notes(),
                Contains(HasSubstr("1 image named otherwise in instances.json: ")))
        << name;
    return dataset->labelled_frames().at(0).sample_id;
  };
  for (const char* name :
       {"data/upload/1/000001.png", "images/1/000001.png", "images\\000001.png", "000001.PNG",
        "C:\\data\\000001.png", "other%2F000001.png", "000001", "/home/me/000001.png"}) {
    EXPECT_EQ(key_of(name), "000001") << name;
  }
  // Accents in one letter or apart (NFC, NFD): of Latin, Vietnamese, Korean, Japanese, Greek
  // letters.
  for (const auto& [disk, listed] : {std::pair("\u00e9t\u00e9.png", "e\u0301te\u0301.png"),
                                     {"e\u0323\u0302.png", "\u1ec7.png"},
                                     {"\uac70\u1112.png", "\u1100\u1165\u1112.png"},
                                     {"\u30ac.png", "\u30ab\u3099.png"},
                                     {"\u03ae.png", "\u03b7\u0301.png"}}) {
    testing::write_flat_image(folder_ / "images" / disk, kImage, 7);
    EXPECT_EQ(key_of(listed), std::filesystem::path(disk).stem().string());
  }
}

TEST_F(CocoLabels, AnotherImageIsNotTakenForOne) {
  testing::write_flat_image(folder_ / "other/000001.png", kImage, 7);
  testing::write_flat_image(folder_ / "set/train/000001.png", kImage, 7);
  // What is there, another split's, and what has its own name.
  write(image(7, "other/000001.png") + "," + image(8, "000001.png"), "");
  EXPECT_EQ(open()->labelled_frames().at(0).label_key, "8");
  write(image(7, "other/000001.png"), "");
  EXPECT_EQ(open()->labelled_frames().at(0).frame.index, -1);
  write(image(7, "cam/000002.png") + "," + image(8, "000001.png"), "");
  EXPECT_EQ(open()->labelled_frames().at(1).frame.index, -1) << "others have no folder";
  write(image(7, "val/000001.png"), "");
  EXPECT_EQ(open("set/train")->labelled_frames().at(0).frame.index, -1);
  write(image(7, "cam/000001.png") + "," + image(8, "images/000001.png"), "");
  EXPECT_EQ(open()->labelled_frames().at(0).label_key, "8");
  write(image(7, "../other/000001.png"), "");
  EXPECT_THAT(open()->labelled_frames().at(0).fault,
              AllOf(HasSubstr("expected an image below images, got ../other/000001.png, which lies "
                              "elsewhere"),
                    HasSubstr("in instances.json#images/7")));
}

TEST_F(CocoLabels, AnotherSequencesImageIsNotTakenForOne) {
  const struct {
    const char *root, *name;
    bool is_taken;
  } cases[] = {
      {"seqA", "seqB/000001.png", false},
      {"seqA", "/data/SeqB/images/000001.png", false},
      {"seqA/images", "seqB/images/000001.png", false},
      {"MOT17-04/img1", "MOT17-02/img1/000001.png", false},
      {"0002", "0001/000001.png", false},
      {"city", "highway/000001.png", false},
      {"left", "right\\000001.png", false},
      {"0002/images", "images/1/000001.png", true},
      {"seqA", "images/1/000001.png", true},
      {"seqA", "seqA/rgb/000001.png", true},
      {"seqA", "/home/me/seqA/images/000001.png", true},
      {"city/frames", "highway/000001.png", true},
      {"images", "/abs/path/images/000001.png", true},
      {"images", "C:\\Users\\me\\000001.png", true},
  };
  for (const auto& [root, name, is_taken] : cases) {
    testing::write_flat_image(folder_ / root / "000001.png", kImage, 7);
    write(image(7, name), "");
    const auto dataset = open(root);
    EXPECT_EQ(dataset->labelled_frames().at(0).frame.index >= 0, is_taken) << root << ' ' << name;
  }
  // Of several folders any may be another video.
  write(image(7, "a/000001.png") + "," + image(8, "b/000002.png"), "");
  expect_refused(
      "expected images' paths below images, got 2 folders that it has not: a, b, in "
      "instances.json");
}

TEST_F(CocoLabels, OfALargerSetWhatIsNotThereIsNoted) {
  std::string images = image(1, "000001.png");
  for (int id = 2; id < 12; ++id) images += "," + image(id, "gone" + std::to_string(id) + ".png");
  write(images, "");
  EXPECT_EQ(open()->labelled_frames().size(), 1u);
  EXPECT_THAT(open()->notes(), Contains("10 of 11 images in instances.json are not in images, and "
                                        "left out: gone2.png, gone3.png, gone4.png, ..."));
}

TEST_F(CocoLabels, AnImageMayHaveNoBoxes) {
  write(image(7, "000001.png"), "");
  EXPECT_THAT(annotation("7").boxes, IsEmpty());
  EXPECT_EQ(annotation("7").original,
            "{\"image\": " + image(7, "000001.png") + ", \"annotations\": []}");
}

TEST_F(CocoLabels, FileNamesMayBeginWithWhatTheRootEndsIn) {
  write(image(1, "images/000001.png") + "," + image(2, "./000002.png") + "," +
            image(3, (folder_ / "images" / "000003.png").string()),
        "");
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 3u);
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    EXPECT_EQ(dataset->paired_frame(frame, 0).state, PairedFrame::State::kPresent);
  }
}

TEST_F(CocoLabels, ABareNameMayBeInAFolder) {
  testing::write_flat_image(folder_ / "clips/a/x.png", kImage, 7);
  testing::write_flat_image(folder_ / "clips/b/y.png", kImage, 7);
  testing::write_flat_image(folder_ / "clips/a/z.png", kImage, 7);
  testing::write_flat_image(folder_ / "clips/b/z.png", kImage, 7);
  write(image(1, "x.png") + "," + image(2, "b/y.png") + "," + image(3, "a/z.png"), "");
  const auto dataset = open("clips");
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].sample_id, "a/x");
  EXPECT_EQ(frames[1].sample_id, "a/z");
  EXPECT_EQ(frames[2].sample_id, "b/y");
  write(image(1, "z.png"), "");
  EXPECT_THAT([&] { open("clips"); }, ThrowsMessage<InputError>(HasSubstr(
                                          "got 1 bare name that several of its folders "
                                          "have: z.png, in instances.json (a/z.png, b/z.png)")));
  // A folder that is not there is no other one.
  write(image(1, "c/x.png") + "," + image(2, "c/z.png"), "");
  EXPECT_EQ(open("clips")->labelled_frames().at(0).frame.index, -1);
  EXPECT_EQ(open("clips")->labelled_frames().at(1).frame.index, -1);
}

TEST_F(CocoLabels, AnEntryWithoutImageIsASampleWhoseFrameIsMissing) {
  write(image(1, "000001.png") + "," + image(8, "images/gone.png") + "," + image(9, "000001.jpg"),
        box(4, 8, "[1, 1, 2, 2]"));
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].sample_id, "000001");
  EXPECT_EQ(frames[1].sample_id, "000001.jpg") << "the name without extension is taken";
  EXPECT_EQ(frames[2].sample_id, "gone");
  for (const int steps : {-1, 0, 1}) {
    const PairedFrame frame = dataset->paired_frame(frames[2], steps);
    EXPECT_EQ(frame.state, PairedFrame::State::kMissing);
    EXPECT_EQ(frame.frame.path, "images/gone.png");
  }
}

TEST_F(CocoLabels, TwoEntriesOfOneImageAreAFaultOfIt) {
  write(image(1, "000001.png") + "," + image(2, "images/000001.png"), "");
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_EQ(dataset->labelled_frames()[0].fault,
            "expected one label of images/000001.png, got two, in instances.json#images/1 and "
            "instances.json#images/2");
}

TEST_F(CocoLabels, ABadEntryIsAFaultOfItsImage) {
  const auto with = [&](const std::string& annotation) {
    write(image(7, "000001.png") + "," + image(8, "000002.png"), annotation);
    EXPECT_FALSE(is_fault(open()->annotation("8")));
    return fault();
  };
  EXPECT_THAT(with(box(17, 7, "[1, 2, -3, 4]")),
              HasSubstr("instances.json (annotation 17): $.bbox[2]: expected a number 0..1e+06, "
                        "got -3"));
  EXPECT_THAT(with(box(17, 7, "[1, 2, 3]")), HasSubstr("expected left, top, width, height"));
  EXPECT_THAT(with(box(17, 7, "[1, null, 3, 4]")), HasSubstr("$.bbox[1]: expected a number"));
  EXPECT_THAT(with(box(17, 7, "[1e300, 1, 3, 4]")), HasSubstr("$.bbox[0]: expected a number"));
  EXPECT_THAT(with(box(17, 7, "[1, 2, 3, 4]", R"(, "iscrowd": 2)")), HasSubstr("$.iscrowd"));
  EXPECT_THAT(with(box(17, 7, "[1, 2, 3, 4]", R"(, "area": -1)")), HasSubstr("$.area"));
  EXPECT_THAT(with(box(17, 7, "[1, 2, 3, 4]", R"(, "bbox": [1, 2, 3, 4])")),
              HasSubstr("expected the key once"));
  EXPECT_THAT(with(R"({"id": 17, "image_id": 7, "category_id": 4, "bbox": [1, 2, 3, 4]})"),
              HasSubstr("$.category_id: expected the id of a category, got 4"));
  EXPECT_THAT(with(R"({"image_id": 7, "bbox": [1, 2, 3, 4]})"),
              HasSubstr("instances.json (annotation): $.category_id"));
  EXPECT_EQ(with(box(17, 7, "[39.9, 2, 3, 4]")), "no fault") << "some of it is within";
  EXPECT_THAT(fault("12"), HasSubstr("expected an image of the file, got none"));
  EXPECT_THAT(fault("x"), HasSubstr("expected an image of the file, got none"));
}

TEST_F(CocoLabels, TracksAreCalledAsToolsCallThem) {
  for (const auto& [more, track] : {std::pair(R"(, "track_id": 3)", 3),
                                    {R"(, "instance_id": 4.0)", 4},
                                    {R"(, "attributes": {"track_id": 0})", 0},
                                    {R"(, "track_id": null, "instance_id": 5)", 5},
                                    {R"(, "track_id": -1)", -1},
                                    {R"(, "track_id": "7", "attributes": [1])", -1},
                                    {", \"ids\": 2", -1}}) {
    write(image(7, "000001.png"),
          box(1, 7, "[1, 2, 3, 4]", more) + "," + box(2, 7, "[1, 2, 5, 6]", R"(, "track_id": 90)"));
    EXPECT_EQ(annotation("7").boxes.at(0).track_id, track) << more;
    EXPECT_EQ(annotation("7").boxes.at(1).track_id, 90);
  }
  write(image(7, "000001.png"), box(1, 7, "[1, 2, 3, 4]", R"(, "instance_id": 1)") + "," +
                                    box(2, 7, "[1, 2, 5, 6]", R"(, "instance_id": 1)"));
  EXPECT_EQ(annotation("7").boxes.at(0).track_id, -1) << "it is no object's number";
  EXPECT_EQ(annotation("7").boxes.at(1).track_id, -1);
}

TEST_F(CocoLabels, CrowdsAreToldByANumberOrABoolean) {
  for (const auto& [crowd, ignore] : {std::pair("0", false),
                                      {"1", true},
                                      {"false", false},
                                      {"true", true},
                                      {"1.0", true},
                                      {"null", false}}) {
    write(image(7, "000001.png"),
          box(1, 7, "[1, 2, 3, 4]", std::string(", \"iscrowd\": ") + crowd));
    EXPECT_EQ(fault(), "no fault") << crowd;
    EXPECT_EQ(annotation("7").boxes.at(0).ignore, ignore) << crowd;
    write(image(7, "000001.png"),
          box(1, 7, "[1, 2, 3, 4]", std::string(R"(, "iscrowd": 0, "ignore": )") + crowd));
    EXPECT_EQ(annotation("7").boxes.at(0).ignore, ignore) << crowd;
  }
  for (const char* crowd : {"\"true\"", "2", "0.5"}) {
    write(image(7, "000001.png"),
          box(1, 7, "[1, 2, 3, 4]", std::string(", \"iscrowd\": ") + crowd));
    EXPECT_THAT(fault(), HasSubstr("(annotation 1): $.iscrowd: expected")) << crowd;
  }
}

TEST_F(CocoLabels, AnotherSizeOfTheImageIsAFault) {
  write(image(7, "000001.png", {40, 30}), box(1, 7, "[1, 2, 3, 4]"));
  EXPECT_EQ(fault(),
            "expected an image of 30x40, as instances.json#images/7 says, got 40x30, in "
            "images/000001.png");
  write(R"({"id": 7, "file_name": "000001.png", "width": 40})", "");
  EXPECT_THAT(fault(), HasSubstr("instances.json (image 7): $.height: expected"));
}

TEST_F(CocoLabels, WhatIsNoImageOfThatSizeOrFormatIsNamed) {
  using namespace std::string_literals;
  const auto file = folder_ / "images/turned.jpg";
  testing::write_flat_image(file, kImage, 7);
  const std::string exif = "MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"s;
  std::string jpeg = testing::read_file(file);
  jpeg.insert(2, "\xff\xe1\0\x22"s + "Exif\0\0"s + exif);
  testing::write_file(file, jpeg);
  write(image(7, "turned.jpg"), "");
  EXPECT_EQ(fault(),
            "expected an image of 40x30, as instances.json#images/7 says, got 30x40, turned "
            "upright as its EXIF orientation says, in images/turned.jpg");
  testing::write_file(folder_ / "images/a.heic", "x");
  testing::write_file(folder_ / "images/b.avif", "x");
  write(image(1, "000001.png") + "," + image(7, "a.heic") + "," + image(8, "b.jpg"), "");
  const auto dataset = open();
  for (const auto& [i, name] : {std::pair(1u, "a.heic"), {2u, "b.avif"}}) {
    EXPECT_EQ(dataset->labelled_frames().at(i).fault,
              "expected a frame, got a file of another format, which ImageMagick converts "
              "(mogrify -format png), in images/" +
                  std::string(name));
  }
}

TEST_F(CocoLabels, AFileThatIsNoneIsRefused) {
  const auto refused = [&](const std::string& text, const std::string& why) {
    testing::write_file(folder_ / "instances.json", text);
    expect_refused(why);
  };
  refused("", "expected JSON, got a parse error");
  refused("[]", "expected an object, got a list, in instances.json (byte 1)");
  refused("7", "expected an object, got a number");
  refused("{}", "expected a list \"images\", got none, in instances.json");
  refused(R"({"images": [], "annotations": []})", "expected a list \"categories\", got none");
  refused(R"({"images": [], "images": []})", "expected the key \"images\" once, got it twice");
  refused(R"({"images": {}})", "expected a list of objects as \"images\", got an object");
  refused(R"({"images": [[]]})", "expected a list of objects as \"images\", got a list");
  refused(R"({"images": [7]})", "expected a list of objects as \"images\", got a number");
  refused(R"({"images": [{}]})", "expected an entry of \"images\" with id, got none");
  refused(R"({"images": [{"id": 1}]})", "with file_name, got none");
  refused(R"({"images": [{"id": "1"}]})", "expected a whole number as \"id\", got text");
  refused(R"({"images": [{"id": 1, "id": 1}]})", "expected the key \"id\" once");
  refused(R"({"images": [{"id": 1, "file_name": []}]})", "expected text as \"file_name\"");
  refused(R"({"annotations": [{"id": 1}]})", "with image_id, got none");
  refused(R"({"categories": [{"id": 1, "name": "a", "keypoints": [1]}]})",
          "expected names as keypoints, got a number");
  refused(R"({"images": [], "annotations": [], "categories": []} x)", "expected JSON");
  refused(std::string(R"({"images": [], "annotations": [], "categories": []})") + '\0' + "x",
          "expected JSON, got a NUL");
  refused(R"({"images": [{"id": 1, "file_name": ")"
          "\xff"
          R"("}]})",
          "expected JSON");
  refused(R"({"annotations": [{"image_id": 1, "bbox": [NaN, 1, 2, 3]}]})", "expected JSON");
  refused(R"({"annotations": [{"image_id": 1, "bbox": [1e999, 1, 2, 3]}]})", "expected JSON");
  std::string whole;
  write(image(1, "000001.png"), box(1, 1, "[1, 2, 3, 4]"));
  whole = testing::read_file(folder_ / "instances.json");
  for (std::size_t length = 0; length + 1 < whole.size(); ++length) {
    testing::write_file(folder_ / "instances.json", whole.substr(0, length));
    EXPECT_THROW(open(), InputError) << length;
  }
  std::filesystem::remove(folder_ / "instances.json");
  expect_refused("No such file");
}

TEST_F(CocoLabels, WhatBelongsToNothingIsCountedAndNamed) {
  write(image(1, "000001.png") + "," + image(1, "000002.png"), "");
  expect_refused("expected each image's id once, got 1 more often: 1, in instances.json");
  std::string annotations;
  for (int i = 0; i < 25; ++i) annotations += (i > 0 ? "," : "") + box(i, 100 + i, "[1, 2, 3, 4]");
  write(image(1, "000001.png"), annotations);
  expect_refused("expected annotations of the file's images, got 25 of other image_ids: 100, 101");
  expect_refused("118, 119, ..., in instances.json");
  write(image(1, "000001.png"),
        R"({"id": 1, "image_id": 1, "category_id": 1, "bbox": [1, 1, 2, 2]},
           {"id": 2, "image_id": 1, "category_id": 2, "bbox": [1, 1, 2, 2]})",
        R"({"id": 1, "name": "a"}, {"id": 2, "name": "a"})");
  expect_refused(
      "expected each category with a name of its own, without control characters, got 1 others");
  write(image(1, "000001.png"), "", R"({"id": 1, "name": "a"}, {"id": 1, "name": "b"})");
  expect_refused("expected each category's id once, got 1 more often: 1");
}

TEST_F(CocoLabels, NestingAsDeepAsTheFileIsNoTrouble) {
  const std::string deep(200'000, '[');
  testing::write_file(folder_ / "instances.json", "{\"info\": " + deep);
  expect_refused("expected JSON");
  const std::string closed = std::string(100, '[') + std::string(100, ']');
  write(image(7, "000001.png"), box(1, 7, "[1, 2, 3, 4]", ", \"segmentation\": " + closed));
  EXPECT_THAT(fault(), HasSubstr("levels of nesting"));
}

TEST_F(CocoLabels, AFileThatHasChangedIsAFault) {
  write(image(7, "000001.png"), box(1, 7, "[1, 2, 3, 4]"));
  const auto dataset = open();
  write(image(8, "000001.png"), box(1, 8, "[1, 2, 3, 4]"));
  EXPECT_TRUE(is_fault(dataset->annotation("7")));
  testing::write_file(folder_ / "instances.json", "{}");
  EXPECT_TRUE(is_fault(dataset->annotation("7")));
}

TEST_F(CocoLabels, LabelsBesideTheImagesAreNoLeftOvers) {
  write("", "");
  std::filesystem::rename(folder_ / "instances.json", folder_ / "images/_annotations.coco.json");
  testing::write_file(folder_ / "images/000001.json", "{}");
  SourceSpec spec;
  spec.root = "images";
  spec.labels = LabelSpec{LabelFormat::kCoco, "images/_annotations.coco.json"};
  EXPECT_THAT([&] { open_frames_dataset(spec, folder_.path()); },
              ThrowsMessage<InputError>(
                  HasSubstr("expected labels of the frames in images, got of none of the 3")));
  testing::write_file(
      folder_ / "images/_annotations.coco.json",
      "{\"images\": [" + image(1, "000001.png") + "], \"annotations\": [], \"categories\": []}");
  EXPECT_THAT(open_frames_dataset(spec, folder_.path())->notes(),
              ElementsAre(HasSubstr("no label for 2 of 3 frames"),
                          "1 file left out in images: 000001.json"));
}

}  // namespace
}  // namespace eventgan
