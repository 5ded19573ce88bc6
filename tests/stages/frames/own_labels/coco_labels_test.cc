
#include <nlohmann/json.hpp>

#include "manifests/files/input_file.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

constexpr ImageSize kImage{30, 40};

/// A folder with images, and COCO labels beside it.
class CocoLabels : public FolderTest {
 protected:
  CocoLabels() { images({"images/000001.png", "images/000002.png", "images/000003.png"}, kImage); }

  static std::string image(int id, const std::string& name, ImageSize size = kImage) {
    return nlohmann::json{
        {"id", id}, {"file_name", name}, {"width", size.width}, {"height", size.height}}
        .dump();
  }
  static std::string box(int id, int image_id, const std::string& bbox,
                         const std::string& more = "", int category = 3) {
    return "{\"id\": " + std::to_string(id) + ", \"image_id\": " + std::to_string(image_id) +
           ", \"category_id\": " + std::to_string(category) + ", \"bbox\": " + bbox + more + "}";
  }

  void file(const std::string& text) const { write("instances.json", text); }
  void write_coco(const std::string& images, const std::string& annotations = "",
                  const std::string& categories = R"({"id": 3, "name": "person"})") const {
    file("{\"info\": {\"year\": [1, {}]}, \"images\": [" + images + "], \"annotations\": [" +
         annotations + "], \"categories\": [" + categories + "]}");
  }
  /// Image 7, 000001.png, with these annotations.
  void of_one(const std::string& annotations,
              const std::string& categories = R"({"id": 3, "name": "person"})") const {
    write_coco(image(7, "000001.png"), annotations, categories);
  }
  /// That with one box and more keys.
  void one_with(const std::string& more,
                const std::string& categories = R"({"id": 3, "name": "person"})") const {
    of_one(box(1, 7, "[1, 2, 30, 20]", more), categories);
  }
  /// Images 1, 2 and so on without annotations.
  void list(const Texts& names) const {
    std::string all;
    for (int id = 1; const std::string& name : names) {
      all += (id > 1 ? "," : "") + image(id, name);
      ++id;
    }
    write_coco(all);
  }

  std::unique_ptr<Dataset> open(const std::string& root = "images") const {
    SourceSpec spec;
    spec.root = root;
    spec.labels = LabelSpec{LabelFormat::kCoco, "instances.json"};
    return open_frames_dataset(spec, folder_.path());
  }
  Annotation annotation(const std::string& key = "7") const { return annotation_of(*open(), key); }
  std::string fault(const std::string& key = "7") const {
    return fault_of(open()->annotation(key));
  }
  Texts joint_names() const { return open()->label_schema().joint_names; }
  void expect_refused(const std::string& why) const { EXPECT_THROWS(open(), InputError, why); }
};

TEST_F(CocoLabels, TheFileIsOpenedOnceAndOfEachImageItsEntriesAreReadAgain) {
  const std::string first = image(7, "000001.png"), second = image(9, "000003.png");
  const std::string of_first = box(1, 7, "[1, 2, 3, 4]"), of_second = box(2, 9, "[0, 0, 40, 30]");
  write_coco(first + "," + second, of_first + "," + of_second);
  const InputCounter counter;
  const auto dataset = open();
  for (const std::size_t i : {0, 1}) EXPECT_EQ(fault_of(*dataset, i), "no fault");
  const InputCounter::Count count = counter.of(at("instances.json"));
  EXPECT_EQ(count.opens, 1u);
  EXPECT_EQ(count.bytes, fs::file_size(at("instances.json")) + first.size() + second.size() +
                             of_first.size() + of_second.size());
}

TEST_F(CocoLabels, OfTheImagesThatTheyName) {
  // Ids neither sorted nor dense, annotations between each other's, entries with odd spaces.
  const std::string crowd = box(1, 7, "[1, 2, 3.5, 4]", R"(, "iscrowd": 1)");
  const std::string spaced = box(3, 7, "[ -2, 1e1 , 5,25 ]");
  write_coco(image(9, "000003.png") + ",\n" + image(7, "000001.png"),
             crowd + "," + box(2, 9, "[0,0,40,30]") + ", " + spaced);
  const auto dataset = open();
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("person"));
  EXPECT_THAT(dataset->label_schema().joint_names, IsEmpty());
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("instances.json"));
  EXPECT_THAT(dataset->notes(), ElementsAre("no label for 1 of 3 frames in instances.json: no "
                                            "samples of their own"));
  ASSERT_EQ(dataset->labelled_frames().size(), 2u);
  EXPECT_EQ(text_of(dataset->labelled_frames()[0]), "000001 of frames: images/000001.png 1 by 7");
  EXPECT_EQ(dataset->label_place("7"), "instances.json#images/7");
  // Frame 2 has no label, and is a paired frame.
  EXPECT_THAT(paired(*dataset, 1, {-1, 0}),
              ElementsAre("present images/000002.png 2", "present images/000003.png 3"));
  const Annotation read = annotation();
  EXPECT_THAT(read.boxes, ElementsAre(Box{.xyxy = {1, 2, 4.5, 6}, .ignore = true},
                                      Box{.xyxy = {-2, 10, 3, 35}}));
  EXPECT_THAT(read.persons, IsEmpty());
  EXPECT_EQ(read.original, "{\"image\": " + image(7, "000001.png") + ", \"annotations\": [" +
                               crowd + ", " + spaced + "]}");
  EXPECT_THAT(rectangles(annotation("9")), ElementsAre(Rectangle{0, 0, 40, 30}));
}

TEST_F(CocoLabels, ClassesAreNumberedByAscendingId) {
  of_one(box(1, 7, "[1, 1, 2, 2]", "", 90) + "," + box(2, 7, "[1, 1, 2, 2]", "", 2),
         R"({"id": 90, "name": "b"}, {"id": 2, "name": "c"}, {"id": 5, "name": "a"})");
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("c", "a", "b"));
  EXPECT_EQ(annotation().boxes.at(0).class_id, 2);
  EXPECT_EQ(annotation().boxes.at(1).class_id, 0);
}

TEST_F(CocoLabels, ACategoryThatNoneHasIsNoClassBesideItsNamesake) {
  // Roboflow's root: in a split with annotations, and in one without any.
  for (const std::string& annotations :
       {box(1, 7, "[1, 1, 2, 2]", "", 1), ""s, box(1, 7, "[1, 1, 2, 2]", "", 0)}) {
    of_one(annotations, R"({"id": 0, "name": "fish"}, {"id": 1, "name": "fish"},
                           {"id": 2, "name": "crab"})");
    EXPECT_THAT(open()->label_schema().class_names, ElementsAre("fish", "crab"));
    if (!annotations.empty()) {
      EXPECT_EQ(annotation().boxes.at(0).class_id, 0);
    }
  }
}

TEST_F(CocoLabels, KeypointsAreMeasuredFromTheImagesEdge) {
  const std::string person =
      R"({"id": 3, "name": "person", "keypoints": ["nose", "eye", "ear"], "skeleton": [[1, 2]]})";
  of_one(box(1, 7, "[1, 2, 30, 20]",
             R"(, "num_keypoints": 2, "keypoints": [10, 12, 2, 0, 0, 0, 11.5, 13, 1])") +
             "," +
             box(2, 7, "[1, 2, 3, 4]", R"(, "num_keypoints": 0, "keypoints": [0,0,0,0,0,0,0,0,0])"),
         person);
  EXPECT_THAT(joint_names(), ElementsAre("nose", "eye", "ear"));
  const Annotation read = annotation();
  EXPECT_EQ(read.boxes.size(), 2u);
  ASSERT_EQ(read.persons.size(), 1u) << "nothing is annotated of the second";
  EXPECT_EQ(read.persons[0].box, (Rectangle{1, 2, 31, 22}));
  EXPECT_THAT(read.persons[0].joints,
              ElementsAre(Joint{{9.5, 11.5}, 1}, Joint{kMissingPoint, 0}, Joint{{11, 12.5}, 0}));
  for (const auto& [keypoints, why] :
       {std::pair("[1, 2, 2]",
                  "instances.json (annotation 1): $.keypoints: expected x, y, v of "
                  "each of 3 joints, got an array of 3"),
        {"[1, 2, 3, 0, 0, 0, 0, 0, 0]", "$.keypoints[2]: expected"},
        // Whole numbers as 2.0, and a count of joints that counts otherwise.
        {"[1.0, 2.5, 2.0, 0, 0, 0, 0, 0, 0.0], \"num_keypoints\": 2", "no fault"}}) {
    one_with(", \"keypoints\": "s + keypoints, person);
    EXPECT_THAT(fault(), HasSubstr(why));
  }
  EXPECT_EQ(annotation().persons.at(0).joints.at(0), (Joint{{0.5, 2}, 1}));
  of_one("", person + R"(, {"id": 4, "name": "dog", "keypoints": ["nose", "tail"]})");
  expect_refused("expected one list of keypoints, got two, of \"dog\" another, in instances.json");
}

TEST_F(CocoLabels, JointsWithoutNamesAreNumberedIfAllAreAsMany) {
  const auto with = [&](const std::string& first, const std::string& second,
                        const std::string& categories) {
    of_one(box(1, 7, "[1, 2, 30, 20]", ", \"keypoints\": " + first) + "," +
               box(2, 7, "[1, 2, 30, 20]", ", \"keypoints\": " + second),
           categories);
    return open();
  };
  const std::string face = R"({"id": 3, "name": "face", "keypoints": []})";
  for (const std::string& category : {face, R"({"id": 3, "name": "face"})"s}) {
    EXPECT_THAT(with("[10, 12, 2, 11.5, 13, 1]", "[]", category)->label_schema().joint_names,
                ElementsAre("0", "1"));
    ASSERT_EQ(annotation().persons.size(), 1u);
    EXPECT_THAT(annotation().persons[0].joints,
                ElementsAre(Joint{{9.5, 11.5}, 1}, Joint{{11, 12.5}, 0}));
  }
  EXPECT_THAT(with("[0, 0, 0]", "[]", face)->label_schema().joint_names, IsEmpty());
  const char* note =
      "keypoints of 2 annotations left out, since their category names none and they differ in "
      "number, in instances.json";
  const auto differing = with("[1, 2, 2]", "[1, 2, 2, 3, 4, 2]", face);
  EXPECT_THAT(differing->notes(), Contains(note));
  EXPECT_THAT(differing->label_schema().joint_names, IsEmpty());
  EXPECT_EQ(annotation().boxes.size(), 2u);
  EXPECT_THAT(annotation().persons, IsEmpty());
  // Beside a category that names one joint.
  const auto beside = with("[1, 2, 2, 3, 4, 2]", "[1, 2, 2, 3, 4, 2]",
                           face + R"(, {"id": 4, "name": "dog", "keypoints": ["nose"]})");
  EXPECT_THAT(beside->notes(), Contains(note));
  EXPECT_THAT(beside->label_schema().joint_names, ElementsAre("nose"));
}

TEST_F(CocoLabels, WholeBodysFeetFaceAndHandsAreJoints) {
  const auto list = [](const std::string& name, int joints, const std::string& first) {
    std::string text = ", \"" + name + "\": [" + first;
    for (int i = 1; i < joints; ++i) text += ", 0, 0, 0";
    return text + "]";
  };
  const std::string person = R"({"id": 3, "name": "person", "keypoints": ["nose", "eye"]})";
  const std::string body = R"(, "keypoints": [10, 12, 2, 0, 0, 0])";
  of_one(box(1, 7, "[1, 2, 30, 20]",
             body + list("foot_kpts", 6, "1, 2, 2") + list("face_kpts", 68, "3, 4, 0.5") +
                 list("lefthand_kpts", 21, "5, 6, 1") + list("righthand_kpts", 21, "7, 8, 2") +
                 R"(, "righthand_valid": false)") +
             "," + box(2, 7, "[1, 2, 30, 20]", body),
         person);
  const Texts names = joint_names();
  ASSERT_EQ(names.size(), 2u + 116u);
  // From 8 on those of the face: MMPose swaps face-0 and face-16, face-36 and face-45, face-41 and
  // face-46; 8 is the chin.
  const std::pair<std::size_t, const char*> at[] = {
      {2, "left_big_toe"},      {8 + 0, "right_face_0"},   {8 + 16, "left_face_0"},
      {8 + 8, "face_8"},        {8 + 36, "right_face_36"}, {8 + 45, "left_face_36"},
      {8 + 46, "left_face_41"}, {8 + 30, "face_30"},       {8 + 67, "left_face_65"},
      {8 + 26, "left_face_17"}, {8 + 35, "left_face_31"},  {8 + 42, "left_face_39"},
      {8 + 54, "left_face_48"}, {8 + 59, "left_face_55"},  {8 + 64, "left_face_60"},
      {8 + 68, "left_hand_0"},  {117, "right_hand_20"}};
  for (const auto& [i, name] : at) EXPECT_EQ(names[i], name);
  const Annotation read = annotation();
  ASSERT_EQ(read.persons.size(), 2u) << read.original;
  const std::vector<Joint>& joints = read.persons[0].joints;
  ASSERT_EQ(joints.size(), names.size());
  EXPECT_EQ(joints[0], (Joint{{9.5, 11.5}, 1}));
  EXPECT_EQ(joints[2], (Joint{{0.5, 1.5}, 1}));
  EXPECT_EQ(joints[8], (Joint{{2.5, 3.5}, -1})) << "a share of certainty";
  EXPECT_EQ(joints[8 + 68], (Joint{{4.5, 5.5}, 0}));
  EXPECT_EQ(joints[8 + 68 + 21], (Joint{kMissingPoint, 0})) << "it is not valid";
  EXPECT_EQ(read.persons[1].joints.size(), names.size());
  one_with(R"(, "face_kpts": [1, 2, 2])", person);
  EXPECT_THAT(fault(), HasSubstr("$.face_kpts: expected x, y, v of each of 68 joints"));
}

TEST_F(CocoLabels, PoseTracksUnlabelledFramesAreNoneAndItsRegionsAreIgnored) {
  const std::string rest = R"(, "width": 40, "height": 30, "is_labeled": )";
  const std::string regions = R"(, "ignore_regions_x": [[10, 20, 20, 10], [1, 2, 3]],
                                  "ignore_regions_y": [[5, 5, 9, 9], [4, 4, 4]])";
  const std::string labelled = R"({"id": 7, "file_name": "000001.png")" + rest;
  const std::string persons = R"({"id": 1, "name": "hat"},
                                 {"id": 3, "name": "person", "keypoints": ["nose"]})";
  const std::string one =
      box(1, 7, "[1, 2, 30, 20]",
          R"(, "keypoints": [9, 8, 2], "bbox_head": [3, 4, 5, 6], "track_id": 2)");
  write_coco(
      labelled + "true" + regions + R"(}, {"id": 8, "file_name": "000002.png")" + rest + "false}",
      one, persons);
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_THAT(dataset->notes(), Contains(HasSubstr("no label for 2 of 3 frames")));
  const Annotation read = annotation();
  ASSERT_EQ(read.boxes.size(), 2u) << read.original;
  EXPECT_FALSE(read.boxes[0].ignore);
  EXPECT_EQ(read.boxes[1], (Box{.class_id = 1,
                                .xyxy = {10, 5, 20, 9},
                                .ignore = true,
                                .outline = read.boxes[1].outline}));
  EXPECT_THAT(read.left_out, ElementsAre(HasSubstr("got 0 x 0, in instances.json#images/7")));
  EXPECT_EQ(read.persons.at(0).head_box, (Rectangle{3, 4, 8, 10}));
  // What has objects is labelled, whatever is said of it.
  write_coco(labelled + "false}", one, persons);
  EXPECT_EQ(open()->labelled_frames().size(), 1u);
  write_coco(labelled + R"(true, "ignore_regions_x": [[1]], "ignore_regions_y": [[1, 2]]})", one,
             persons);
  EXPECT_THAT(fault(), HasSubstr("$.ignore_regions_y: expected as many numbers as"));
}

TEST_F(CocoLabels, ABoxOutsideTheImageOrWithoutAreaIsLeftOut) {
  for (const auto& [bbox, why] :
       {std::pair("[40, 2, 3, 4]",
                  "expected a box within the image of 40x30, got one from (40, 2) "
                  "to (43, 6), in instances.json (annotation 17)"),
        {"[4, 2, 0, 4], \"iscrowd\": 1",
         "expected a box of a width and height above 0, got 0 x 4, "
         "in instances.json (annotation 17)"},
        {"[4, 2, 3.5, 0]", "got 3.5 x 0, in"}}) {
    of_one(box(17, 7, bbox) + "," + box(18, 7, "[1, 2, 3, 4]"));
    EXPECT_EQ(annotation().boxes.size(), 1u);
    EXPECT_THAT(annotation().left_out, ElementsAre(HasSubstr(why)));
  }
}

TEST_F(CocoLabels, WhatNoLabelComesOfDoesNotMatter) {
  write_coco(
      R"({"id": 7.0, "file_name": "000001.png", "width": 40.0, "height": 3e1})",
      R"({"id": 1, "image_id": 7.0, "category_id": 3.0, "bbox": [1, 2, 3, 4], "area": null,
            "iscrowd": null, "keypoints": null})",
      R"({"id": 0, "name": "person", "supercategory": "none"}, {"id": 3, "name": "person"})");
  EXPECT_THAT(open()->label_schema().class_names, ElementsAre("person"));
  EXPECT_THAT(annotation().boxes, ElementsAre(Box{.xyxy = {1, 2, 4, 6}}));
}

TEST_F(CocoLabels, CornersInPlaceOfSidesAreAWarning) {
  const std::string beyond = box(1, 7, "[20, 10, 30, 25]"), within = box(2, 7, "[20, 10, 10, 15]");
  of_one(beyond + "," + beyond + "," + within);
  EXPECT_THAT(open()->warnings(),
              ElementsAre(HasSubstr("2 of 3 compared boxes reach beyond their image: \"bbox\"")));
  of_one(beyond + "," + beyond + "," + within + "," + within);
  EXPECT_THAT(open()->warnings(), IsEmpty());
  of_one(beyond + "," + beyond);
  EXPECT_THAT(open()->warnings(), IsEmpty()) << "too few to tell";
}

TEST_F(CocoLabels, ImagesMayBeNamedAsToolsWriteThem) {
  const auto expect_sample = [&](const std::string& name, const std::string& sample_id) {
    SCOPED_TRACE(name);
    list({name});
    EXPECT_THAT(open()->notes(),
                Contains(HasSubstr("1 image named otherwise in instances.json: ")));
    EXPECT_EQ(open()->labelled_frames().at(0).sample_id, sample_id);
  };
  for (const char* name :
       {"data/upload/1/000001.png", "images/1/000001.png", "images\\000001.png", "000001.PNG",
        "C:\\data\\000001.png", "other%2F000001.png", "000001", "/home/me/000001.png"}) {
    expect_sample(name, "000001");
  }
  // Accents in one letter or apart (NFC, NFD): of Latin, Vietnamese, Korean, Japanese, Greek
  // letters.
  for (const auto& [disk, listed] : {std::pair("\u00e9t\u00e9.png", "e\u0301te\u0301.png"),
                                     {"e\u0323\u0302.png", "\u1ec7.png"},
                                     {"\uac70\u1112.png", "\u1100\u1165\u1112.png"},
                                     {"\u30ac.png", "\u30ab\u3099.png"},
                                     {"\u03ae.png", "\u03b7\u0301.png"}}) {
    images({"images/"s + disk}, kImage);
    expect_sample(listed, fs::path(disk).stem().string());
  }
}

TEST_F(CocoLabels, AnotherImageIsNotTakenForOne) {
  images({"other/000001.png", "set/train/000001.png"}, kImage);
  const struct {
    Texts names;
    const char* what;
    std::size_t frame;
    const char* key;  ///< of its label; none: no image is taken
    const char* root = "images";
  } cases[] = {{{"other/000001.png", "000001.png"}, "what is there", 0, "2"},
               {{"other/000001.png"}, "what is there", 0, nullptr},
               {{"cam/000002.png", "000001.png"}, "others have no folder", 1, nullptr},
               {{"val/000001.png"}, "another split's", 0, nullptr, "set/train"},
               {{"cam/000001.png", "images/000001.png"}, "what has its own name", 0, "2"}};
  for (const auto& [names, what, frame, key, root] : cases) {
    SCOPED_TRACE(names[0] + " " + what);
    list(names);
    const auto dataset = open(root);
    const LabelledFrame& found = dataset->labelled_frames().at(frame);
    if (key != nullptr) {
      EXPECT_EQ(found.label_key, key);
    }
    EXPECT_EQ(found.frame.index >= 0, key != nullptr);
  }
  list({"../other/000001.png"});
  EXPECT_THAT(open()->labelled_frames().at(0).fault,
              AllOf(HasSubstr("expected an image below images, got ../other/000001.png, which lies "
                              "elsewhere"),
                    HasSubstr("in instances.json#images/1")));
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
    write_flat_image(folder_ / root / "000001.png", kImage, 7);
    write_coco(image(7, name), "");
    const auto dataset = open(root);
    EXPECT_EQ(dataset->labelled_frames().at(0).frame.index >= 0, is_taken) << root << ' ' << name;
  }
  // Of several folders any may be another video.
  write_coco(image(7, "a/000001.png") + "," + image(8, "b/000002.png"), "");
  expect_refused(
      "expected images' paths below images, got 2 folders that it has not: a, b, in "
      "instances.json");
}

TEST_F(CocoLabels, OfALargerSetWhatIsNotThereIsNoted) {
  Texts names{"000001.png"};
  for (int id = 2; id < 12; ++id) names.push_back("gone" + std::to_string(id) + ".png");
  list(names);
  EXPECT_EQ(open()->labelled_frames().size(), 1u);
  EXPECT_THAT(open()->notes(), Contains("10 of 11 images in instances.json are not in images, and "
                                        "left out: gone2.png, gone3.png, gone4.png, ..."));
}

TEST_F(CocoLabels, AnImageMayHaveNoBoxes) {
  of_one("");
  EXPECT_EQ(
      annotation(),
      (Annotation{"{\"image\": " + image(7, "000001.png") + ", \"annotations\": []}", {}, {}}));
}

TEST_F(CocoLabels, FileNamesMayBeginWithWhatTheRootEndsIn) {
  list({"images/000001.png", "./000002.png", at("images/000003.png").string()});
  const auto dataset = open();
  ASSERT_EQ(dataset->labelled_frames().size(), 3u);
  for (const std::size_t i : {0, 1, 2}) {
    EXPECT_THAT(paired(*dataset, i, {0}), ElementsAre(StartsWith("present")));
  }
}

TEST_F(CocoLabels, ABareNameMayBeInAFolder) {
  images({"clips/a/x.png", "clips/b/y.png", "clips/a/z.png", "clips/b/z.png"}, kImage);
  list({"x.png", "b/y.png", "a/z.png"});
  EXPECT_THAT(ids_of(*open("clips")), ElementsAre("a/x", "a/z", "b/y"));
  list({"z.png"});
  EXPECT_THROWS(open("clips"), InputError,
                "got 1 bare name that several of its folders have: z.png, in instances.json "
                "(a/z.png, b/z.png)");
  // A folder that is not there is no other one.
  list({"c/x.png", "c/z.png"});
  for (const std::size_t i : {0, 1}) {
    EXPECT_EQ(open("clips")->labelled_frames().at(i).frame.index, -1);
  }
}

TEST_F(CocoLabels, AnEntryWithoutImageIsASampleWhoseFrameIsMissing) {
  write_coco(
      image(1, "000001.png") + "," + image(8, "images/gone.png") + "," + image(9, "000001.jpg"),
      box(4, 8, "[1, 1, 2, 2]"));
  // The name without extension is taken.
  EXPECT_THAT(ids_of(*open()), ElementsAre("000001", "000001.jpg", "gone"));
  EXPECT_THAT(paired(*open(), 2, {-1, 0, 1}), Each("missing images/gone.png -1"));
}

TEST_F(CocoLabels, TwoEntriesOfOneImageAreAFaultOfIt) {
  list({"000001.png", "images/000001.png"});
  EXPECT_THAT(faults_of(*open()),
              ElementsAre("expected one label of images/000001.png, got two, in "
                          "instances.json#images/1 and instances.json#images/2"));
}

TEST_F(CocoLabels, ABadEntryIsAFaultOfItsImage) {
  const std::pair<std::string, const char*> cases[] = {
      {box(17, 7, "[1, 2, -3, 4]"),
       "instances.json (annotation 17): $.bbox[2]: expected a number "
       "0..1e+06, got -3"},
      {box(17, 7, "[1, 2, 3]"), "expected left, top, width, height"},
      {box(17, 7, "[1, null, 3, 4]"), "$.bbox[1]: expected a number"},
      {box(17, 7, "[1e300, 1, 3, 4]"), "$.bbox[0]: expected a number"},
      {box(17, 7, "[1, 2, 3, 4]", R"(, "iscrowd": 2)"), "$.iscrowd"},
      {box(17, 7, "[1, 2, 3, 4]", R"(, "area": -1)"), "$.area"},
      {box(17, 7, "[1, 2, 3, 4]", R"(, "bbox": [1, 2, 3, 4])"), "expected the key once"},
      {box(17, 7, "[1, 2, 3, 4]", "", 4), "$.category_id: expected the id of a category, got 4"},
      {R"({"image_id": 7, "bbox": [1, 2, 3, 4]})", "instances.json (annotation): $.category_id"},
      {box(17, 7, "[39.9, 2, 3, 4]"), "no fault"}};  // some of it is within
  for (const auto& [annotation, why] : cases) {
    write_coco(image(7, "000001.png") + "," + image(8, "000002.png"), annotation);
    EXPECT_EQ(fault("8"), "no fault");
    EXPECT_THAT(fault(), HasSubstr(why));
  }
  for (const char* key : {"12", "x"}) {
    EXPECT_THAT(fault(key), HasSubstr("expected an image of the file, got none"));
  }
}

TEST_F(CocoLabels, TracksAreCalledAsToolsCallThem) {
  const auto tracks = [&](const std::string& first, const std::string& second) {
    of_one(box(1, 7, "[1, 2, 3, 4]", first) + "," + box(2, 7, "[1, 2, 5, 6]", second));
    return std::pair(annotation().boxes.at(0).track_id, annotation().boxes.at(1).track_id);
  };
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  for (const auto& [more, track] : {std::pair(R"(, "track_id": 3)", std::int64_t{3}),
                                    {R"(, "track_id": 9223372036854775807)", kMost},
                                    {R"(, "track_id": 9223372036854775808)", -1},
                                    {R"(, "track_id": 18446744073709551610)", -1},
                                    {R"(, "instance_id": 4.0)", 4},
                                    {R"(, "attributes": {"track_id": 0})", 0},
                                    {R"(, "track_id": null, "instance_id": 5)", 5},
                                    {R"(, "track_id": -1)", -1},
                                    {R"(, "track_id": "7", "attributes": [1])", 7},
                                    {R"(, "track_id": "a-7")", -1},
                                    {", \"ids\": 2", -1}}) {
    EXPECT_THAT(tracks(more, R"(, "track_id": 90)"), Pair(track, 90)) << more;
  }
  EXPECT_THAT(tracks(R"(, "instance_id": 1)", R"(, "instance_id": 1)"), Pair(-1, -1))
      << "it is no object's number";
}

TEST_F(CocoLabels, ItIsToldWhyATrackIsLeftOut) {
  const auto left_out = [&](const std::string& first, const std::string& second) {
    of_one(box(1, 7, "[1, 2, 3, 4]", first) + "," + box(2, 7, "[1, 2, 5, 6]", second));
    return annotation().tracks_left_out;
  };
  const auto is_none = [&](const char* got) {
    return ElementsAre(
        StartsWith("expected a whole number from 0 as track, got "s + got + ", in "));
  };
  for (const char* more : {"", R"(, "track_id": null)", R"(, "track_id": "")",
                           R"(, "track_id": -1)", R"(, "track_id": "7")", R"(, "track_id": "-1")",
                           R"(, "track_id": "a-7", "instance_id": 3)"}) {
    EXPECT_THAT(left_out(more, ""), IsEmpty()) << more;
  }
  EXPECT_THAT(left_out(R"(, "track_id": "a-7")", ""), is_none(R"('"a-7"')"));
  EXPECT_THAT(left_out(R"(, "attributes": {"track_id": 4.5})", ""), is_none("'4.5'"));
  EXPECT_THAT(left_out(R"(, "track_id": 9223372036854775808)", ""),
              is_none("'9223372036854775808'"));
  EXPECT_THAT(left_out(R"(, "track_id": 1)", R"(, "track_id": 1)"),
              ElementsAre("expected each track once in an image, got track 1 of 2 boxes, in "
                          "instances.json#images/7"));
}

TEST_F(CocoLabels, CrowdsAreToldByANumberOrABoolean) {
  for (const auto& [crowd, ignore] : {std::pair("0", false),
                                      {"1", true},
                                      {"false", false},
                                      {"true", true},
                                      {"1.0", true},
                                      {"null", false}}) {
    for (const std::string key : {", \"iscrowd\": ", R"(, "iscrowd": 0, "ignore": )"}) {
      one_with(key + crowd);
      EXPECT_EQ(annotation().boxes.at(0).ignore, ignore) << key << crowd;
    }
  }
  for (const char* crowd : {"\"true\"", "2", "0.5"}) {
    one_with(", \"iscrowd\": "s + crowd);
    EXPECT_THAT(fault(), HasSubstr("(annotation 1): $.iscrowd: expected")) << crowd;
  }
}

TEST_F(CocoLabels, AnotherSizeOfTheImageIsAFault) {
  write_coco(image(7, "000001.png", {40, 30}), box(1, 7, "[1, 2, 3, 4]"));
  EXPECT_EQ(fault(),
            "expected an image of 30x40, as instances.json#images/7 says, got 40x30, in "
            "images/000001.png");
  write_coco(R"({"id": 7, "file_name": "000001.png", "width": 40})");
  EXPECT_THAT(fault(), HasSubstr("instances.json (image 7): $.height: expected"));
  write_coco(R"({"id": 7, "file_name": "000001.png"})", box(1, 7, "[1, 2, 3, 4]"));
  EXPECT_THAT(rectangles(annotation_of(*open())), ElementsAre(Rectangle{1, 2, 4, 6}));
}

TEST_F(CocoLabels, WhatIsNoImageOfThatSizeOrFormatIsNamed) {
  const auto file = at("images/turned.jpg");
  write_flat_image(file, kImage, 7);
  const std::string exif = "MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"s;
  std::string jpeg = read_file(file);
  jpeg.insert(2, "\xff\xe1\0\x22"s + "Exif\0\0"s + exif);
  write_file(file, jpeg);
  write_coco(image(7, "turned.jpg"), "");
  EXPECT_EQ(fault(),
            "expected an image of 40x30, as instances.json#images/7 says, got 30x40, turned "
            "upright as its EXIF orientation says, in images/turned.jpg");
  write("images/a.heic", "x");
  write("images/b.avif", "x");
  write_coco(image(1, "000001.png") + "," + image(7, "a.heic") + "," + image(8, "b.jpg"), "");
  const auto dataset = open();
  for (const auto& [i, name] : {std::pair(1u, "a.heic"), {2u, "b.avif"}}) {
    EXPECT_EQ(dataset->labelled_frames().at(i).fault,
              "expected a frame, got a file of another format, which ImageMagick converts "
              "(mogrify -format png), in images/" +
                  std::string(name));
  }
  write_flat_image(at("images/sub/c.png"), kImage, 7);
  write_coco(image(1, "000001.png") + "," + image(7, "sub/c.png"), "");
  EXPECT_THAT(open()->labelled_frames().at(1).fault,
              StartsWith("expected a frame, got an image that was passed over, in a folder beside "
                         "images"));
}

TEST_F(CocoLabels, AFileThatIsNoneIsRefused) {
  const std::string empty = R"({"images": [], "annotations": [], "categories": []})";
  const std::pair<std::string, const char*> cases[] = {
      {"", "expected JSON, got a parse error"},
      {"[]", "expected an object, got a list, in instances.json (byte 1)"},
      {"7", "expected an object, got a number"},
      {"{}", "expected a list \"images\", got none, in instances.json"},
      {R"({"images": [], "annotations": []})", "expected a list \"categories\", got none"},
      {R"({"images": [], "images": []})", "expected the key \"images\" once, got it twice"},
      {R"({"images": {}})", "expected a list of objects as \"images\", got an object"},
      {R"({"images": [[]]})", "expected a list of objects as \"images\", got a list"},
      {R"({"images": [7]})", "expected a list of objects as \"images\", got a number"},
      {R"({"images": [{}]})", "expected an entry of \"images\" with id, got none"},
      {R"({"images": [{"id": 1}]})", "with file_name, got none"},
      {R"({"images": [{"id": "1"}]})", "expected a whole number as \"id\", got text"},
      {R"({"images": [{"id": 1, "id": 1}]})", "expected the key \"id\" once"},
      {R"({"images": [{"id": 1, "file_name": []}]})", "expected text as \"file_name\""},
      {R"({"annotations": [{"id": 1}]})", "with image_id, got none"},
      {R"({"categories": [{"id": 1, "name": "a", "keypoints": [1]}]})",
       "expected names as keypoints, got a number"},
      {empty + " x", "expected JSON"},
      {empty + '\0' + "x", "expected JSON, got a NUL"},
      {"{\"images\": [{\"id\": 1, \"file_name\": \"\xff\"}]}", "expected JSON"},
      {R"({"annotations": [{"image_id": 1, "bbox": [NaN, 1, 2, 3]}]})", "expected JSON"},
      {R"({"annotations": [{"image_id": 1, "bbox": [1e999, 1, 2, 3]}]})", "expected JSON"},
      {"{\"info\": " + std::string(200'000, '['), "expected JSON"}};
  for (const auto& [text, why] : cases) {
    file(text);
    expect_refused(why);
  }
  write_coco(image(1, "000001.png"), box(1, 1, "[1, 2, 3, 4]"));
  const std::string whole = read_file(at("instances.json"));
  for (std::size_t length = 0; length + 1 < whole.size(); ++length) {
    file(whole.substr(0, length));
    EXPECT_THROWS(open(), InputError, "expected JSON, got ", "in instances.json") << length;
  }
  fs::remove(at("instances.json"));
  expect_refused("No such file");
}

TEST_F(CocoLabels, WhatBelongsToNothingIsCountedAndNamed) {
  write_coco(image(1, "000001.png") + "," + image(1, "000002.png"));
  expect_refused("expected each image's id once, got 1 more often: 1, in instances.json");
  std::string annotations;
  for (int i = 0; i < 25; ++i) annotations += (i > 0 ? "," : "") + box(i, 100 + i, "[1, 2, 3, 4]");
  of_one(annotations);
  expect_refused("expected annotations of the file's images, got 25 of other image_ids: 100, 101");
  expect_refused("118, 119, ..., in instances.json");
  of_one(box(1, 7, "[1, 1, 2, 2]", "", 1) + "," + box(2, 7, "[1, 1, 2, 2]", "", 2),
         R"({"id": 1, "name": "a"}, {"id": 2, "name": "a"})");
  expect_refused(
      "expected each category with a name of its own, without control characters, got 1 others");
  of_one("", R"({"id": 1, "name": "a"}, {"id": 1, "name": "b"})");
  expect_refused("expected each category's id once, got 1 more often: 1");
}

TEST_F(CocoLabels, NestingAsDeepAsTheFileIsNoTrouble) {
  one_with(", \"segmentation\": " + std::string(100, '[') + std::string(100, ']'));
  EXPECT_THAT(fault(), HasSubstr("levels of nesting"));
}

TEST_F(CocoLabels, AFileThatHasChangedIsAFault) {
  of_one(box(1, 7, "[1, 2, 3, 4]"));
  const auto dataset = open();
  write_coco(image(8, "000001.png"), box(1, 8, "[1, 2, 3, 4]"));
  EXPECT_NE(fault_of(*dataset), "no fault");
  file("{}");
  EXPECT_NE(fault_of(*dataset), "no fault");
}

TEST_F(CocoLabels, LabelsBesideTheImagesAreNoLeftOvers) {
  SourceSpec spec;
  spec.root = "images";
  spec.labels = LabelSpec{LabelFormat::kCoco, "images/_annotations.coco.json"};
  const auto open_beside = [&](const Texts& names) {
    list(names);
    fs::rename(at("instances.json"), at("images/_annotations.coco.json"));
    return open_frames_dataset(spec, folder_.path());
  };
  write("images/000001.json", "{}");
  EXPECT_THROWS(open_beside({}), InputError,
                "expected labels of the frames in images, got of none of the 3");
  EXPECT_THAT(open_beside({"000001.png"})->notes(),
              ElementsAre(HasSubstr("no label for 2 of 3 frames"),
                          "1 file left out in images: 000001.json"));
}

}  // namespace
}  // namespace eventgan
