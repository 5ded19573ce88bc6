#include "stages/frames/sources/find_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "manifests/values/faults.h"
#include "stages/frames/listing/image_folder.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::ThrowsMessage;

class FindSource : public ::testing::Test {
 protected:
  void write(const fs::path& name, const std::string& text = "") {
    fs::create_directories((folder_.path() / name).parent_path());
    testing::write_file(folder_.path() / name, text);
  }
  FoundSource find(const fs::path& name, std::optional<DatasetKind> dataset = std::nullopt) {
    return find_sources(folder_.path() / name, dataset).front();
  }
  fs::path at(const fs::path& name) const { return folder_.path() / name; }

  testing::TemporaryFolder folder_;
};

TEST_F(FindSource, KnowsEachDatasetByItsNames) {
  const struct {
    std::string root, file;
    DatasetKind dataset;
    std::string_view layout;
  } cases[] = {
      {"object", "label_2/000000.txt", DatasetKind::kKittiObject, ""},
      {"tracking", "label_02/0000.txt", DatasetKind::kKittiTracking, ""},
      {"raw", "2011_09_26/2011_09_26_drive_0001_sync/image_02/data/0000000000.png",
       DatasetKind::kKittiRaw, ""},
      {"mpii", "mpii_human_pose_v1_u12_1.mat", DatasetKind::kMpii, ""},
      {"mpii2", "mpii_human_pose_v1_u12_2/mpii_human_pose_v1_u12_1.mat", DatasetKind::kMpii, ""},
      {"fetch", "S1/Walking-1/annot.h5", DatasetKind::kHuman36m, "fetch"},
      {"fetch2", "S11/Walking-1/imageSequence/54138969/img_000001.jpg", DatasetKind::kHuman36m,
       "fetch"},
      {"extracted", "S1/S1_Walking_1.54138969/S1_Walking_1.54138969_000001.jpg",
       DatasetKind::kHuman36m, "extracted"},
      {"official", "S1/MyPoseFeatures/D2_Positions/Walking 1.54138969.cdf", DatasetKind::kHuman36m,
       "official"},
      {"images", "a.PNG", DatasetKind::kFrames, ""},
      {"folders", "clip/1.jpg", DatasetKind::kFrames, ""},
      {"videos", "clip.MOV", DatasetKind::kFrames, ""},
  };
  for (const auto& expected : cases) {
    write(expected.root + "/" + expected.file);
    for (const auto& dataset : {std::optional<DatasetKind>(), std::optional(expected.dataset)}) {
      const FoundSource found = find(expected.root, dataset);
      EXPECT_EQ(found.dataset, expected.dataset) << expected.root;
      EXPECT_EQ(found.layout, expected.layout) << expected.root;
      EXPECT_EQ(found.root, at(expected.root));
    }
  }
  EXPECT_EQ(find("videos/clip.MOV").dataset, DatasetKind::kFrames);
}

TEST_F(FindSource, LooksIntoTheFolders) {
  write("kitti/training/label_2/000000.txt");
  write("kitti/testing/image_2/000000.png");
  EXPECT_EQ(find("kitti/").root, at("kitti/training"));
  write("kitti/more/S1/Walking-1/annot.h5");
  EXPECT_EQ(find("kitti", DatasetKind::kHuman36m).root, at("kitti/more"));
  EXPECT_THAT([&] { find("kitti"); },
              ThrowsMessage<InputError>(HasSubstr(
                  "expected one dataset, got 2: more (human36m), training (kitti_object), "
                  "in ")));
}

TEST_F(FindSource, KittiRawAndTheDevkitLieBesideKittiObject) {
  write("data/kitti/training/label_2/000000.txt");
  EXPECT_THAT(find("data/kitti").remarks,
              AllOf(Contains(HasSubstr("no devkit")), Contains(HasSubstr("no prev_2")),
                    Contains(HasSubstr("no calib"))));
  write("data/kitti/devkit/mapping/train_mapping.txt");
  FoundSource found = find("data/kitti");
  EXPECT_EQ(found.devkit, at("data/kitti/devkit"));
  EXPECT_EQ(found.raw_root, std::nullopt);
  EXPECT_THAT(found.remarks, Contains(HasSubstr("no raw_root")));
  write("data/raw/2011_09_26/2011_09_26_drive_0001_sync/image_02/data/0000000000.png");
  write("data/kitti/training/prev_2/000000_01.png");
  write("data/kitti/training/calib/000000.txt");
  found = find("data/kitti/training");
  EXPECT_EQ(found.raw_root, at("data/raw"));
  EXPECT_THAT(found.remarks, IsEmpty());
  write("data/2011_09_28/2011_09_28_drive_0001_sync/image_02/data/0000000000.png");
  EXPECT_EQ(find("data/kitti").raw_root, at("data")) << "the days themselves";
}

TEST_F(FindSource, AListOfPeopleIsKnownByItsContent) {
  const std::string list = R"([{"image": "a.jpg", "joints": []}])";
  write("people/images/a.jpg");
  write("people/annot/valid.json", list);
  write("people/annot/coco.json", R"({"images": []})");
  write("people/annot/none.json", "[]");
  FoundSource found = find("people");
  EXPECT_EQ(found.dataset, DatasetKind::kMpiiList);
  EXPECT_EQ(found.annotations, at("people/annot/valid.json"));
  EXPECT_THAT(found.remarks, Contains(HasSubstr("no sequences")));
  write("people/annot/train.json", list);
  write("sequences/a/1.jpg");
  found = find("people");
  EXPECT_EQ(found.annotations, at("people/annot/train.json"));
  EXPECT_EQ(found.sequences, at("sequences"));
  EXPECT_THAT(found.remarks, ::testing::ElementsAre(HasSubstr("annot/valid.json")));
  write("people/mpii_human_pose_v1_u12_1.mat");
  EXPECT_EQ(find("people").dataset, DatasetKind::kMpii) << "it has more than the list";
}

TEST_F(FindSource, VideosAreFoundByThemselvesAndInFolders) {
  write("videos/1.mp4");
  EXPECT_THAT(find("videos").remarks, IsEmpty());
  EXPECT_THAT(find("videos/1.mp4").remarks, IsEmpty());
}

TEST_F(FindSource, SaysOfWhichDatasetTheFramesAreAPart) {
  const struct {
    std::string label, frames, root;
  } cases[] = {{"kitti/training/label_2/000000.txt", "kitti/training/image_2", "kitti/training"},
               {"kitti/training/label_2/000000.txt", "kitti/training/prev_2", "kitti/training"},
               {"tracking/label_02/0000.txt", "tracking/image_02/0000", "tracking"},
               {"raw/2011_09_26/a/oxts", "raw/2011_09_26/drive/image_02/data", "raw"},
               {"mpii/mpii_human_pose_v1_u12_1.mat", "mpii/images", "mpii"},
               {"h36m/S1/Walking-1/annot.h5", "h36m/S1/Walking-1/imageSequence/5", "h36m"}};
  for (const auto& part : cases) {
    write(part.label);
    write(part.frames + "/000000.png");
    const FoundSource found = find(part.frames);
    EXPECT_EQ(found.root, at(part.frames));
    ASSERT_FALSE(found.remarks.empty()) << part.frames;
    EXPECT_THAT(found.remarks.front(),
                AllOf(HasSubstr("warning: this is only a part of "),
                      ::testing::EndsWith("eventgan init \"" + at(part.root).string() + "\"")));
  }
  write("mini/label_2/000000.txt");
  write("mini/images/000000.png");
  EXPECT_THAT(find("mini/images").remarks.front(), ::testing::EndsWith("in image_2"));
  EXPECT_EQ(find("mini").dataset, DatasetKind::kFrames) << "its images are where KITTI has none";
  write("mini/other/000000.png");
  EXPECT_THAT(find("mini/other").remarks, Not(Contains(HasSubstr("a part of"))));
}

TEST_F(FindSource, SaysWhatThereIsInstead) {
  write("testing/image_2/000000.png");
  write("notes/readme.txt");
  write("images/1.png");
  const auto refused = [](const std::string& text) {
    return ThrowsMessage<InputError>(AllOf(HasSubstr(text), Not(HasSubstr("\n"))));
  };
  EXPECT_THAT([&] { find("notes"); }, refused("got none of these, in "));
  EXPECT_THAT([&] { find("notes/readme.txt"); }, refused("got none of these, in "));
  EXPECT_THAT([&] { find("testing"); }, refused("got none of these, in "));
  EXPECT_THAT([&] { find("absent"); }, refused("expected a folder or a video, got "));
  EXPECT_THAT([&] { find("images", DatasetKind::kMpii); },
              refused("expected mpii, got frames, in "));
  EXPECT_THAT([&] { find("notes", DatasetKind::kFrames); },
              refused("expected frames, got none of these, in "));
}

TEST_F(FindSource, SaysWhatAFileIsAndWhatToDoWithIt) {
  using namespace std::string_literals;
  const struct {
    std::string name, text, title, way_out;
  } cases[] = {
      {"x.aedat", "#!AER-DAT2.0\r\n\xc0", "AEDAT of another version than 4.0", "write AEDAT4"},
      {"instances.json", R"({"images": [{"file_name": "a"}], "annotations": []})",
       "labels as COCO's", "give the folder of its images"},
      {"a.xml", "<annotation>", "XML", "give the folder"},
      {"videos.txt", "clips/a.mp4\nclips/b.mp4\n", "a list of files", "eventgan init A B"},
      {"boxes.csv", "image,class,left\n", "a table", "give the folder"},
      {"EventGAN.pt", "\x80\x02\x8a\n", "a checkpoint of PyTorch", "eventgan import-weights"},
      {"new.pt", "PK\3\4 archive/data.pkl", "a checkpoint of PyTorch", "eventgan import-weights"},
      {"a.zip", "PK\3\4 a.jpg", "an archive", "unpack it"},
      {"w.safetensors", "\x10\0\0\0\0\0\0\0{}"s, "weights", "a manifest names them"},
      {"a.jpg", "\xff\xd8\xff", "an image", "give its folder"}};
  for (const auto& one : cases) {
    write(one.name, one.text);
    const auto is_said =
        AllOf(HasSubstr("got " + one.title), HasSubstr("in " + at(one.name).string()),
              HasSubstr(one.way_out), Not(HasSubstr("\n")));
    EXPECT_THAT(fault_of_file(at(one.name)), is_said);
    EXPECT_THAT([&] { find(one.name); }, ThrowsMessage<InputError>(is_said));
  }
  write("manifest.json", R"({"format": "eventgan-manifest", "sources": [{"annotations": "a"}]})");
  write("notes.txt", "notes");
  write("commented.json", "\n// of images, annotations\n{}");
  for (const char* name : {"manifest.json", "commented.json", "notes.txt", "nothing"}) {
    EXPECT_EQ(fault_of_file(at(name)), "") << name;
  }
}

TEST_F(FindSource, OfSeveralNamesAllWithTheLineForOneManifest) {
  for (const char* name : {"a", "d"}) {
    write(std::string("data/") + name + "/label_2/000000.txt");
    write(std::string("data/") + name + "/image_2/000000.png");
    write(std::string("many/") + name + "/images/1.png");
  }
  write("data/b/1.png");
  const auto refused = [this](const std::string& names, const std::string& last) {
    return ThrowsMessage<InputError>(
        AllOf(HasSubstr("expected one dataset, got " + names + ", in "),
              HasSubstr("(one manifest of several: eventgan init \""),
              ::testing::EndsWith(" \"" + at(last).string() + "\")")));
  };
  EXPECT_THAT([&] { find("data"); },
              refused("3: a (kitti_object), b (frames), d (kitti_object)", "data/d"));
  EXPECT_THAT([&] { find("many"); }, refused("2: a (frames), d (frames)", "many/d"));
}

TEST_F(FindSource, LabelsOfOnesOwnLieBesideTheImages) {
  const std::string coco = R"({"info": {}, "images": [{"id": 1, "file_name": "1.jpg"}], )"
                           R"("annotations": [], "categories": []})";
  const struct {
    LabelFormat format;
    std::string root, path;  ///< what is to be found
    std::vector<std::pair<std::string, std::string>> files;
  } cases[] = {
      {LabelFormat::kCoco,
       "train2017",
       "annotations/instances_train2017.json",
       {{"train2017/1.jpg", ""},
        {"annotations/instances_train2017.json", coco},
        {"annotations/captions_train2017.json", coco},
        {"annotations/person_keypoints_train2017.json", coco}}},
      {LabelFormat::kCoco, "images", "boxes.json", {{"images/1.jpg", ""}, {"boxes.json", coco}}},
      {LabelFormat::kCoco,
       "train",
       "train/_annotations.coco.json",
       {{"train/1.jpg", ""}, {"train/_annotations.coco.json", coco}, {"test/2.jpg", ""}}},
      {LabelFormat::kCoco,
       "",
       "_annotations.coco.json",
       {{"1.jpg", ""}, {"_annotations.coco.json", coco}}},
      {LabelFormat::kYolo,
       "images",
       "",
       {{"images/train/1.jpg", ""}, {"labels/train/1.txt", ""}, {"data.yaml", ""}}},
      {LabelFormat::kYolo,
       "images",
       "labels",
       {{"images/1.jpg", ""}, {"labels/1.txt", ""}, {"labels/classes.txt", ""}}},
      {LabelFormat::kYolo,
       "train/images",
       "",
       {{"train/images/1.jpg", ""}, {"train/labels/1.txt", ""}, {"data.yaml", ""}}},
      {LabelFormat::kYolo, "", "", {{"1.jpg", ""}, {"1.txt", ""}, {"classes.txt", ""}}},
      {LabelFormat::kVoc,
       "JPEGImages",
       "Annotations",
       {{"JPEGImages/1.jpg", ""}, {"Annotations/1.xml", ""}, {"SegmentationClass/1.png", ""}}},
      {LabelFormat::kVoc, "", "", {{"1.jpg", ""}, {"1.xml", ""}}},
      {LabelFormat::kMot, "", "", {{"s/img1/000001.jpg", ""}, {"s/gt/gt.txt", ""}}},
      {LabelFormat::kMot, "img1", "", {{"img1/000001.jpg", ""}, {"gt/gt.txt", ""}}},
      {LabelFormat::kMot, "images", "", {{"images/s/000001.jpg", ""}, {"s/gt.txt", ""}}},
      {LabelFormat::kCsv,
       "images",
       "boxes.csv",
       {{"images/1.jpg", ""},
        {"boxes.csv", "image,class,left,top,right,bottom\n1.jpg,,,,,\n"},
        {"others.csv", "image,class,left,top,right,bottom\n2.jpg,,,,,\n"},
        {"frames.csv", "image,width\n"}}},
      {LabelFormat::kCsv,
       "",
       "boxes.csv",
       {{"clip.mp4", ""},
        {"boxes.csv", "image,class,left,top,right,bottom,track\nclip/0,,,,,,\n"}}},
  };
  int number = 0;
  for (const auto& expected : cases) {
    const std::string name = "own" + std::to_string(number++);
    for (const auto& [file, text] : expected.files) write(name + "/" + file, text);
    const FoundSource found = find(name);
    EXPECT_EQ(found.dataset, DatasetKind::kFrames) << name;
    EXPECT_EQ(found.root, (at(name) / expected.root / "").parent_path()) << name;
    ASSERT_TRUE(found.labels) << name;
    EXPECT_EQ(found.labels->format, expected.format) << name;
    EXPECT_EQ(found.labels->path / "", at(name) / expected.path / "") << name;
    EXPECT_EQ(find(name + "/" + expected.root).labels->path, found.labels->path) << name;
  }
}

TEST_F(FindSource, LabelsLieWhereToolsPutThem) {
  const std::string mot = "1,1,1,1,2,2,1,1,1\n", yolo = "\xEF\xBB\xBF\n1 0.5 0.5 0.25 0.5\n";
  const auto coco = [](const std::string& images) {
    return "\xEF\xBB\xBF\n{\"annotations\": [{\"id\": 1, \"bbox\": [1, 2, 3, 4], \"image_id\": "
           "1}], "
           "\"categories\": [], \"images\": [" +
           images + "]}";
  };
  const std::string listed = coco(R"({"file_name": "1.jpg", "id": 1})");
  const struct {
    LabelFormat format;
    std::string root, path, split;  ///< what is to be found
    std::vector<std::pair<std::string, std::string>> files;
  } cases[] = {
      {LabelFormat::kCoco,
       "images/default",
       "annotations/instances_default.json",
       "",
       {{"images/default/1.jpg", ""}, {"annotations/instances_default.json", listed}}},
      {LabelFormat::kCoco,
       "val2017",
       "annotations/instances_val2017.json",
       "val",
       {{"val2017/1.jpg", ""}, {"annotations/instances_val2017.json", listed}}},
      {LabelFormat::kCoco,
       "images",
       "result.json",
       "",
       {{"images/1.jpg", ""}, {"result.json", coco(R"({"file_name": "images\/1\/1.jpg"})")}}},
      {LabelFormat::kCoco,
       "images",
       "a.json",
       "",
       {{"images/\uac70 1.jpg", ""}, {"a.json", coco(R"({"file_name": "\uac70 1.jpg"})")}}},
      {LabelFormat::kCoco,
       "Images",
       "Annotations/a.json",
       "",
       {{"Images/1.jpg", ""}, {"Annotations/a.json", listed}}},
      {LabelFormat::kCoco,
       "",
       "labels.json",
       "",
       {{"data/1.jpg", ""}, {"labels.json", listed}, {"._labels.json", "Mac"}}},
      {LabelFormat::kYolo, "", "labels", "", {{"1.jpg", ""}, {"labels/1.txt", yolo}}},
      {LabelFormat::kYolo,
       "Images",
       "",
       "",
       {{"Images/1.jpg", ""}, {"Labels/1.txt", ""}, {"data.yaml", ""}}},
      {LabelFormat::kYolo,
       "",
       "",
       "",
       {{"obj_train_data/1.jpg", ""},
        {"obj_train_data/1.txt", ""},
        {"obj.names", "car"},
        {"obj.data", "classes = 1"},
        {"train.txt", "data/obj_train_data/1.jpg"}}},
      {LabelFormat::kYolo,
       "",
       "",
       "",
       {{"clip.mp4", ""}, {"labels/clip_000012.txt", ""}, {"data.yaml", ""}}},
      {LabelFormat::kYolo,
       "",
       "",
       "",
       {{"clip.mp4", ""}, {"clip/12.txt", ""}, {"classes.txt", ""}}},
      {LabelFormat::kVoc,
       "images",
       "annotations/xmls",
       "",
       {{"images/1.jpg", ""}, {"annotations/xmls/1.xml", ""}}},
      {LabelFormat::kVoc, "images", "labels", "", {{"images/1.jpg", ""}, {"labels/1.xml", ""}}},
      {LabelFormat::kVoc, "images", "xml", "", {{"images/1.jpg", ""}, {"xml/1.xml", ""}}},
      {LabelFormat::kMot, "", "", "", {{"highway.mp4", ""}, {"highway/gt/gt.txt", mot}}},
      {LabelFormat::kMot, "", "", "", {{"highway.mp4", ""}, {"highway.txt", mot}}},
      {LabelFormat::kMot, "", "", "", {{"1.jpg", ""}, {"gt/gt.txt", mot}}},
      {LabelFormat::kCsv,
       "",
       "a.csv",
       "",
       {{"highway.mp4", ""}, {"a.csv", "frame;label;x;y;w;h\nhighway.mp4/12;car;1;2;3;4\n"}}},
      {LabelFormat::kCsv,
       "train",
       "train/_annotations.csv",
       "",
       {{"train/1.jpg", ""},
        {"train/_annotations.csv",
         "filename,width,height,class,xmin,ymin,xmax,ymax\n1.jpg,9,9,car,1,2,3,4\n"}}},
  };
  int number = 0;
  for (const auto& expected : cases) {
    const std::string name = "tool" + std::to_string(number++);
    for (const auto& [file, text] : expected.files) write(name + "/" + file, text);
    const FoundSource found = find(name);
    EXPECT_EQ(found.root, (at(name) / expected.root / "").parent_path()) << name;
    ASSERT_TRUE(found.labels) << name << " " << ::testing::PrintToString(found.unread);
    EXPECT_EQ(found.labels->format, expected.format) << name;
    EXPECT_EQ(found.labels->path / "", at(name) / expected.path / "") << name;
    EXPECT_EQ(found.split, expected.split) << name;
    EXPECT_THAT(found.unread, IsEmpty()) << name;
  }
}

TEST_F(FindSource, WhatLooksLikeLabelsAndIsNotReadIsNamed) {
  const std::string box = R"({"label": "car", "coordinates": {"x": 1}})";
  const std::pair<std::string, std::vector<std::pair<std::string, std::string>>> cases[] = {
      {"CVAT's XML",
       {{"images/1.jpg", ""}, {"annotations.xml", "<annotations><image id=\"0\"/></annotations>"}}},
      {"labelme's", {{"1.jpg", ""}, {"1.json", R"({"shapes": [], "imagePath": "1.jpg"})"}}},
      {"CreateML's",
       {{"train/1.jpg", ""},
        {"train/_annotations.createml.json",
         "[{\"image\": \"1.jpg\", \"annotations\": [" + box + "]}]"}}},
      {"Label Studio's",
       {{"images/1.jpg", ""}, {"project.json", R"([{"id": 1, "data": {}, "annotations": []}])"}}},
      {"YOLO",
       {{"images/a/1.jpg", ""}, {"images/b/2.jpg", ""}, {"labels/2.txt", "0 .5 .5 .2 .2\n"}}},
      {"VisDrone's", {{"images/1.jpg", ""}, {"annotations/1.txt", "684,8,273,116,0,0,0,0\n"}}},
      {"KITTI's",
       {{"images/1.jpg", ""},
        {"label_2/1.txt",
         "Car 0.00 0 -1.58 587 173 614 200 1.65 1.67 3.64 -0.65 1.71 46.70 -1.59\n"}}},
      {"COCO",
       {{"images/1.jpg", ""},
        {"a.json", R"({"images": [{"file_name": "gone.jpg"}], "annotations": [{"bbox": []}]})"}}},
      {"a table of", {{"1.jpg", ""}, {"a.csv", "1.jpg,1,2,3,4,car\n"}}},
      {"a table of", {{"00000.ppm", ""}, {"gt.txt", "00000.ppm;774;411;815;446;11\n"}}},
      {"a table of",
       {{"train/b6ab.jpg", ""},
        {"train.csv", "image_id,width,height,bbox,source\nb6ab,9,9,\"[1.0, 2, 3, 4]\",usask\n"}}},
      {"Open Images'",
       {{"train/0a1b.jpg", ""},
        {"boxes.csv",
         "ImageID,Source,LabelName,Confidence,XMin,XMax,YMin,YMax\n"
         "0a1b,xclick,/m/0k4j,1,0.1,0.2,0.3,0.4\n"}}},
      {"BDD100K's",
       {{"images/100k/train/f-1.jpg", ""},
        {"labels/det_20/det_train.json",
         R"([{"name": "f-1.jpg"}, {"name": "f-2.jpg", "labels": [{"box2d": {"x1": 1}}]}])"}}},
      {"Supervisely's",
       {{"ds/img/im.jpg", ""},
        {"ds/ann/im.jpg.json", R"({"tags": [], "size": {"height": 9}, "objects": []})"},
        {"meta.json", R"({"classes": [], "tags": []})"}}},
      {"DOTA's",
       {{"train/images/P1.png", ""},
        {"train/labelTxt-v1.0/P1.txt",
         "imagesource:GoogleEarth\ngsd:0.1\n"
         "1 1 5 1 5 5 1 5 plane 0\n"}}},
      {"PoseTrack's",
       {{"images/val/000342_mpii/000000.jpg", ""},
        {"annotations/val/000342_mpii.json",
         R"({"images": [{"file_name": "images/val/000342_mpii/000000.jpg"}],)"
         R"( "annotations": [{"bbox": [1, 2, 3, 4], "keypoints": []}]})"}}},
      {"UA-DETRAC's",
       {{"MVI_20011/img00001.jpg", ""},
        {"MVI_20011.xml", "<sequence name=\"MVI_20011\"><frame num=\"1\"><target_list/>"}}},
      {"GOT-10k's or LaSOT's",
       {{"GOT_1/00000001.jpg", ""}, {"GOT_1/groundtruth.txt", "1.0,2.0,3.0,4.0\n"}}},
      {"UAVDT's", {{"M0101/img000001.jpg", ""}, {"M0101_gt_whole.txt", "1,1,1,2,3,4,1,1,1\n"}}},
      {"CrowdHuman's",
       {{"Images/273271,c9db.jpg", ""},
        {"a.odgt", R"({"ID": "273271,c9db", "gtboxes": [{"fbox": [1, 2, 3, 4]}]})"}}},
      {"LVIS's",
       {{"images/000000397133.jpg", ""},
        {"lvis.json",
         R"({"images": [{"id": 1, "coco_url": "http://x/train2017/000000397133.jpg"}],)"
         R"( "annotations": [{"bbox": [1, 2, 3, 4]}]})"}}},
      {"YouTube-VIS's",
       {{"JPEGImages/0a1/00000.jpg", ""},
        {"instances.json",
         R"({"videos": [{"file_names": ["0a1/00000.jpg"]}], "annotations": [{"bboxes": []}]})"}}},
      {"nuImages'",
       {{"samples/CAM/n003.jpg", ""},
        {"v1.0-mini/object_ann.json", R"([{"token": "a", "category_token": "b", "bbox": [1]}])"}}},
      {"AI Challenger's",
       {{"images/70b1.jpg", ""},
        {"a.json", R"([{"image_id": "70b1", "human_annotations": {"human1": [1, 2, 3, 4]}}])"}}},
      {"SoccerNet's",
       {{"img1/000001.jpg", ""},
        {"Labels-GameState.json", R"({"images": [{"file_name": "000001.jpg"}],)"
                                  R"( "annotations": [{"bbox_image": {"x": 1}}]})"}}},
      {"a table of",
       {{"1.jpg", ""}, {"a.csv", "image,class,left,top,right,bottom,score\n1.jpg,a,0,0,1,1,1\n"}}},
  };
  int number = 0;
  for (const auto& [title, files] : cases) {
    const std::string name = "unread" + std::to_string(number++);
    for (const auto& [file, text] : files) write(name + "/" + file, text);
    const FoundSource found = find(name);
    EXPECT_EQ(found.dataset, DatasetKind::kFrames) << name;
    EXPECT_FALSE(found.labels) << name;
    EXPECT_THAT(found.unread,
                ::testing::ElementsAre(AllOf(
                    ::testing::StartsWith(at(name).string()),
                    HasSubstr(" looks like " + title + " labels of these images and is not read: "),
                    HasSubstr("; "))))
        << name;
  }
  EXPECT_THAT(find("unread" + std::to_string(number - 1)).unread.front(),
              HasSubstr("it has a column of scores"));
  EXPECT_THAT(find("unread6").unread.front(), HasSubstr("of other classes than KITTI's"));
  write("none/1.jpg");
  write("none/1.txt", "a street with two cars\n");
  write("none/captions.json", R"([{"image": "1.jpg", "caption": "a street"}])");
  write("none/frames.csv", "image,width,height,sequence,index\n1.jpg,64,48,a,1\n");
  write("none/1.json", R"({"mine": [1, 2]})");
  EXPECT_THAT(find("none").unread, IsEmpty());
}

/// Whatever tool wrote it: by the images that it names, its own name, or its place.
TEST_F(FindSource, WhatNamesTheImagesAndIsNotReadIsNamed) {
  const std::string box = R"({"of": "clip/im1.jpg", "at": [1, 2, 3, 4]})";
  const std::string numbers = testing::npy_doubles({1, 4}, {0, 0, 1, 1});
  const std::pair<std::string, std::string> files[] = {
      {"boxes.json", "{\"seen\": [" + box + "]}"},
      {"boxes.jsonl", box},
      {"more/labels.txt", "im1 4 5 9 9\n"},
      {"joints.csv", "picture,head x,head y\nim1.jpg,4,5\n"},
      {"boxes.xml", "<seen><of>im1.jpg</of></seen>"},
      {"boxes.mat", std::string("MATLAB 5.0 \0i\0m\0001\0.\0j\0p\0g", 25)},
      {"more/deep/er/im1.npy", numbers},
      {"clip.npy", numbers},
      {"clip.txt", "1 2 3 4\n"},
      {"clip_boxes.csv", "frame,l,t,r,b\n1,4,5,9,9\n"},
      {"../gt/clip/im1.txt", "car: 1 2 3 4\n"},
      {"../all.json", box}};
  int number = 0;
  for (const auto& [file, text] : files) {
    const std::string name = "named" + std::to_string(number++);
    write(name + "/set/clip/im1.jpg");
    write(name + "/set/" + file, text);
    const fs::path place = at(name + "/set/" + file).lexically_normal();
    EXPECT_THAT(find(name + "/set").unread,
                ::testing::ElementsAre(AllOf(::testing::StartsWith(place.string()),
                                             HasSubstr(" is not read: no reader of its format"))))
        << file;
    EXPECT_THAT(find(name + "/set").remarks, IsEmpty()) << file;
    // With labels it is a remark.
    write(name + "/set/b.csv", "image,class,left,top,right,bottom\nim1.jpg,a,0,0,1,1\n");
    EXPECT_TRUE(find(name + "/set").labels) << file;
    EXPECT_THAT(find(name + "/set").unread, IsEmpty()) << file;
    EXPECT_THAT(
        find(name + "/set").remarks,
        ::testing::ElementsAre("1 file with names of these images not read: " + place.string()))
        << file;
  }
}

TEST_F(FindSource, WhatNamesTheImagesAndIsNoLabelStopsNothing) {
  const std::pair<std::string, std::string> files[] = {
      {"IMG_0001.jpg.json",
       R"({"title": "IMG_0001.jpg", "photoTakenTime": {"t": 1}, "a": [1, 2, 3]})"},
      {"exif.csv", "SourceFile,FNumber,ISO,Width\nIMG_0001.jpg,2.8,100,640\n"},
      {"IMG_0001.txt", "ExifTool Version : 12.1\nISO : 100 200 300\n"},
      {"README.txt", "IMG_0001.jpg 1 2 3 4\n"},
      {"transforms.json",
       R"({"frames": [{"file_path": "IMG_0001.jpg", "transform_matrix": [1, 2, 3, 4]}]})"},
      {"calib/IMG_0001.txt", "7 0 6 0\n"},
      {"set.txt", "IMG_0001.jpg\nIMG_0002.jpg\n"},
      {"rgb.txt", "# color images\n1305031102.175304 rgb/IMG_0001.jpg\n"},
      {"files.csv", "image,width,height,sequence,index\nIMG_0001.jpg,64,48,a,1\n"},
      {"md5.txt", "d41d8cd98f00b204e9800998ecf8427e  IMG_0001.jpg\n"},
      {"IMG_0001.json", R"({"mine": [1, 2, 3, 4]})"},
      {"out/plan.json",
       R"({"format": "eventgan-plan", "samples": [{"id": "IMG_0001", "n": [1, 2, 3, 4]}]})"},
      {"other.json", R"({"of": "IMG_0003.jpg", "at": [1, 2, 3, 4]})"}};
  for (const auto& [file, text] : files) write("quiet/" + file, text);
  write("quiet/IMG_0001.jpg");
  EXPECT_THAT(find("quiet").unread, IsEmpty());
  EXPECT_THAT(find("quiet").remarks, IsEmpty());
  write("quiet/captions.txt", "IMG_0001.jpg two dogs\n");
  EXPECT_THAT(find("quiet").unread, IsEmpty());
  EXPECT_THAT(find("quiet").remarks,
              ::testing::ElementsAre("1 file with names of these images not read: " +
                                     at("quiet/captions.txt").string()));
  write("quiet/sets/other/images/IMG_0002.jpg");  // another dataset
  write("quiet/sets/other/boxes.json", R"({"of": "IMG_0001.jpg", "at": [1, 2, 3, 4]})");
  EXPECT_THAT(find("quiet").unread, IsEmpty());
}

TEST_F(FindSource, ImagesThatLieTooDeepAreNamed) {
  write("deep/images/train/camA/day1/1.jpg");
  write("deep/labels/train/camA/day1/1.txt", "0 .5 .5 .2 .2\n");
  write("deep/data.yaml", "names: [car]\n");
  EXPECT_THAT([&] { find("deep"); }, ThrowsMessage<InputError>(::testing::EndsWith(
                                         "in " + at("deep").string() +
                                         "; images lie in images/train/camA/day1: run eventgan "
                                         "convert \"" +
                                         at("deep/images/train").string() + "\"")));
  EXPECT_EQ(find("deep/images/train").labels->format, LabelFormat::kYolo);
  write("fetch/S1/Walking-1/annot.h5");
  write("fetch/S1/Walking-1/imageSequence/54138969/img_000001.jpg");
  EXPECT_THAT([&] { find("fetch/S1"); },
              ThrowsMessage<InputError>(
                  AllOf(HasSubstr("this is only a part of Human3.6M"),
                        ::testing::EndsWith("eventgan convert \"" + at("fetch").string() + "\""))));
  // ImageNet's videos: the labels' tree stands beside that of the images.
  write("vid/Data/VID/train/set/clip/000000.JPEG");
  write("vid/Annotations/VID/train/set/clip/000000.xml", "<annotation/>");
  EXPECT_THAT([&] { find("vid"); }, ThrowsMessage<InputError>(HasSubstr("vid/Data/VID/train\"")));
  EXPECT_THAT(find("vid/Data/VID/train").unread,
              ::testing::ElementsAre(HasSubstr("looks like Pascal VOC's")));
}

TEST_F(FindSource, TextsBesideTheImagesAreTakenWhereTheReaderLooks) {
  write("a/imgs/1.jpg");
  write("a/imgs/1.txt");
  write("a/data.yaml");
  EXPECT_EQ(find("a/imgs").labels->path, at("a/imgs")) << "a has neither labels nor these texts";
}

TEST_F(FindSource, LabelsThatAreLeftOutAreRemarks) {
  write("a/images/1.jpg");
  write("a/labels/1.txt");
  FoundSource found = find("a");
  EXPECT_FALSE(found.labels);
  EXPECT_EQ(found.root, at("a"));
  EXPECT_THAT(found.remarks, Contains(HasSubstr("no data.yaml or classes.txt")));
  write("a/data.yaml");
  write("a/boxes.csv", "image,class,left,top,right,bottom\n1.jpg,,,,,\n");
  found = find("a");
  EXPECT_EQ(found.labels->format, LabelFormat::kYolo);
  EXPECT_THAT(found.remarks, Contains(HasSubstr("labels in another format (csv) left out: " +
                                                at("a/boxes.csv").string())));
  for (const char* split : {"train2017", "val2017"}) {
    write(std::string("c/") + split + "/1.jpg");
    write(std::string("c/annotations/instances_") + split + ".json",
          R"({"annotations": [], "images": []})");
  }
  write("c/annotations/instances_val2017.json", R"({"images": [{"file_name": "gone.jpg"}]})");
  found = find("c");
  EXPECT_EQ(found.root, at("c/train2017"));
  EXPECT_EQ(found.labels->path, at("c/annotations/instances_train2017.json"));
  write("d/1.jpg");
  write("d/1.json", R"({"images": "none"})");
  write("d/other.json", R"({"images": [{"file_name": "2.jpg"}]})");
  write("d/table.csv", "image,class\n");
  write("d/notes.txt");
  EXPECT_FALSE(find("d").labels);
  write("d/near.csv", "image,class,left,top,right,bottom,score\n1.jpg,a,0,0,1,1,1\n");
  found = find("d");
  EXPECT_FALSE(found.labels);
  EXPECT_THAT(found.remarks,
              Contains(AllOf(HasSubstr("a table left out, expected columns image, class, "),
                             HasSubstr("got \"score\": " + at("d/near.csv").string()))));
}

TEST_F(FindSource, NamesOfClassesGoBeforeYolosNumbers) {
  write("a/images/1.jpg");
  write("a/labels/1.txt", "0 .5 .5 .2 .2\n");
  const auto expect = [&](LabelFormat format, const char* left_out) {
    const FoundSource found = find("a");
    EXPECT_EQ(found.labels->format, format);
    EXPECT_THAT(found.remarks, Contains(HasSubstr(std::string("labels in another format (") +
                                                  left_out + ") left out: ")));
  };
  write("a/xml/1.xml", "<annotation/>");
  expect(LabelFormat::kVoc, "yolo");
  write("a/classes.txt", "walker\n");
  expect(LabelFormat::kYolo, "voc");
  fs::remove_all(at("a/xml"));
  write("a/boxes.csv", "image,class,left,top,right,bottom\n1.jpg,walker,0,0,1,1\n");
  expect(LabelFormat::kYolo, "csv");
  fs::remove(at("a/classes.txt"));
  expect(LabelFormat::kCsv, "yolo");
}

/// Among or beside images, what the program has made is neither image nor label nor recording.
TEST_F(FindSource, TheProgramsOwnOutputIsPassedOver) {
  const std::string picture("\x89PNG\r\n\x1a\n....tEXtSoftware\0eventgan", 33);
  for (const char* name : {"a/1.jpg", "a/2.jpg", "b/1.jpg"}) write(std::string("set/") + name);
  const auto sequences = [&] {
    const ImageFolder top = list_image_folder(at("set"));
    std::vector<std::string> names;
    for (const std::string& name : top.folders) {
      if (!list_image_folder(at("set") / name).frames.empty()) names.push_back(name);
    }
    return names;
  };
  const std::vector<std::string> before = sequences();
  write("set/out/plan.json", R"({"format":"eventgan-plan"})");
  write("set/out/labels.json", R"({"images": [{"file_name": "1.jpg"}], "annotations": []})");
  write("set/yolo/.export/export.txt", "format yolo\n");
  write("set/yolo/images/train/1.png");
  write("set/previews/s_0000.png", picture);
  write("set/previews/s_0001.png", picture);
  EXPECT_EQ(sequences(), before);
  EXPECT_THAT(list_image_folder(at("set")).left_out,
              ::testing::ElementsAre("out (eventgan's output)", "yolo (eventgan's output)"));
  EXPECT_THAT(list_image_folder(at("set/previews")).left_out,
              Contains("s_0001.png (eventgan's picture)"));
  EXPECT_FALSE(find("set").labels);
  EXPECT_THAT(find("set").remarks, IsEmpty());
  EXPECT_EQ(find("set/yolo").root, at("set/yolo/images")) << "given, it is read";
  write("set/previews/mine.png");  // among pictures it is an image still
  EXPECT_EQ(list_image_folder(at("set/previews")).frames.frames().size(), 1u);
  EXPECT_NO_THROW(require_no_images(at("set/out")));
  for (const char* name : {"set/previews", "set/a"}) {
    EXPECT_THAT([&] { require_no_images(at(name)); },
                ThrowsMessage<UsageError>(HasSubstr("expected a folder without images of others")));
  }
  // A folder of images with results among them is not the program's.
  write("set/b/run.json", R"({"manifest_folder": "/a"})");
  EXPECT_THAT(sequences(), Contains("b"));
}

TEST_F(FindSource, ImagesThatAreLeftOutAreWarnings) {
  write("a/train/images/1.jpg");
  write("a/train/labels/1.txt");
  write("a/valid/images/1.jpg");
  write("a/data.yaml");
  write("a/other/2.png");
  const auto sources = find_sources(at("a"));
  ASSERT_EQ(sources.size(), 1u);
  EXPECT_EQ(sources[0].root, at("a/train/images"));
  EXPECT_THAT(sources[0].remarks, Contains("warning: 2 folders of images left out: other, valid"));
  EXPECT_THAT(find("a/train").remarks, IsEmpty());
  // One file has the labels of both.
  write("b/train/1.jpg");
  write("b/val/1.jpg");
  write("b/boxes.csv",
        "image,class,left,top,right,bottom\ntrain/1.jpg,a,0,0,1,1\nval/1.jpg,a,0,0,1,1\n");
  EXPECT_EQ(find_sources(at("b")).size(), 1u);
  EXPECT_EQ(find("b").root, at("b"));
  EXPECT_THAT(find("b").remarks,
              ::testing::ElementsAre(HasSubstr("warning: images of val are in split train, too")));
}

TEST_F(FindSource, ListsOfSplitsAreNamed) {
  write("voc/JPEGImages/1.jpg");
  write("voc/Annotations/1.xml");
  write("voc/ImageSets/Main/train.txt", "1\n");
  write("voc/ImageSets/Main/car_train.txt", "1 1\n");
  EXPECT_THAT(find("voc").remarks,
              ::testing::ElementsAre(
                  "warning: 1 list of a split not used in " + at("voc/ImageSets/Main").string() +
                  ": train.txt; give each split its own source with \"ids\", a sample id a line"));
  write("flat/test.jpg");  // has a label so called
  write("flat/test.txt");
  EXPECT_THAT(find("flat").remarks, Not(Contains(HasSubstr("of a split"))));
}

TEST_F(FindSource, FoldersOfSequencesMayBeTwoDeep) {
  write("days/monday/a/1.jpg");
  write("days/tuesday/b/1.jpg");
  EXPECT_EQ(find("days").dataset, DatasetKind::kFrames);
  EXPECT_EQ(find("days").root, at("days"));
  // A folder of datasets is none.
  write("sets/one/images/1.jpg");
  write("sets/two/images/1.jpg");
  EXPECT_THROW(find("sets"), InputError);
}

TEST_F(FindSource, ASplitsImagesMayHaveLabelsOfAnyFormatBesideThem) {
  const std::string coco = R"({"images": [{"id": 1, "file_name": "1.jpg"}], "annotations": []})";
  for (const char* split : {"train", "val"}) {
    write("voc/" + std::string(split) + "/images/1.jpg");
    write("voc/" + std::string(split) + "/annotations/1.xml");
    write("coco/" + std::string(split) + "/images/1.jpg");
    write("coco/" + std::string(split) + "/annotations.json", coco);
  }
  for (const char* name : {"voc", "coco"}) {
    const auto sources = find_sources(at(name));
    ASSERT_EQ(sources.size(), 2u) << name;
    for (const FoundSource& source : sources) {
      const std::string split = source.split.empty() ? "train" : std::string(source.split);
      EXPECT_THAT(source.root.string(), ::testing::StartsWith((at(name) / split).string()));
      ASSERT_TRUE(source.labels) << source.root;
      EXPECT_THAT(source.labels->path.string(), HasSubstr(split + "/annotations"));
    }
    EXPECT_EQ(sources[1].split, "val");
  }
}

TEST_F(FindSource, SplitsWithLabelsOfTheirOwnAreSources) {
  const auto splits = [&](const fs::path& name) {
    std::vector<std::array<std::string, 3>> found;
    for (const FoundSource& source : find_sources(at(name))) {
      found.push_back({std::string(source.split),
                       source.root.lexically_relative(at(name)).generic_string(),
                       source.labels->path.lexically_relative(at(name)).generic_string()});
    }
    return found;
  };
  using Splits = std::vector<std::array<std::string, 3>>;
  for (const char* split : {"valid", "train", "test"}) {
    write("roboflow/" + std::string(split) + "/images/1.jpg");
    write("roboflow/" + std::string(split) + "/labels/1.txt");
    write("yolo/images/" + std::string(split) + "/1.jpg");
    if (split != std::string("test")) write("yolo/labels/" + std::string(split) + "/1.txt");
    write("voc/" + std::string(split) + "/1.jpg");
    write("voc/" + std::string(split) + "/1.xml");
  }
  for (const char* name : {"Training", "VAL"}) {
    write("caps/" + std::string(name) + "/1.jpg");
    write("caps/" + std::string(name) + "/1.xml");
    write("dev/" + std::string(name == std::string("VAL") ? "dev" : "train") + "/1.jpg");
    write("dev/" + std::string(name == std::string("VAL") ? "dev" : "train") + "/1.xml");
  }
  EXPECT_EQ(splits("caps"), (Splits{{"", "Training", "Training"}, {"val", "VAL", "VAL"}}));
  EXPECT_EQ(splits("dev"), (Splits{{"", "train", "train"}, {"val", "dev", "dev"}}));
  write("roboflow/data.yaml");
  EXPECT_EQ(splits("roboflow"), (Splits{{"", "train/images", "."},
                                        {"val", "valid/images", "."},
                                        {"test", "test/images", "."}}));
  EXPECT_THAT(find("roboflow").remarks, IsEmpty());
  write("yolo/data.yaml");
  EXPECT_EQ(splits("yolo"), (Splits{{"", "images/train", "."}, {"val", "images/valid", "."}}));
  EXPECT_THAT(find("yolo").remarks,
              ::testing::ElementsAre("warning: 1 folder of images left out: images/test"));
  EXPECT_EQ(splits("yolo/images").size(), 2u);
  EXPECT_EQ(splits("voc"),
            (Splits{{"", "train", "train"}, {"val", "valid", "valid"}, {"test", "test", "test"}}));
  for (const char* split : {"train2017", "val2017"}) {
    write("coco/" + std::string(split) + "/1.jpg");
    write("coco/annotations/instances_" + std::string(split) + ".json",
          R"({"annotations": [], "images": []})");
  }
  EXPECT_EQ(splits("coco"), (Splits{{"", "train2017", "annotations/instances_train2017.json"},
                                    {"val", "val2017", "annotations/instances_val2017.json"}}));
  // Other images of the folder would be lost.
  write("yolo/images/more/1.jpg");
  write("yolo/labels/more/1.txt");
  EXPECT_EQ(splits("yolo"), (Splits{{"", "images", "."}}));
  // A folder that was asked for is its split alone.
  EXPECT_EQ(splits("voc/valid"), (Splits{{"", ".", "."}}));
}

TEST_F(FindSource, SplitsAreAsTheDatasetSays) {
  const std::string text = "0 .5 .5 .2 .2\n";
  const struct {
    std::string name;
    std::vector<std::array<std::string, 3>> splits;  ///< split, root, list
    std::vector<std::pair<std::string, std::string>> files;
    std::vector<std::string> images;
    std::vector<std::string> remarks = {};
  } cases[] = {
      {"folders",
       {{"", "images/a", ""}, {"", "images/b", ""}, {"val", "images/c", ""}},
       {{"data.yaml",
         "path: .\ntrain:\n  - images/a\n  - images/b\nval: images/c\nnames: [car]\n"}},
       {"images/a/1", "images/b/2", "images/c/3"}},
      {"holdout",
       {{"", "images/train", ""}, {"val", "images/holdout", ""}},
       {{"own.yaml", "train: ../x/images/train\nval: /elsewhere/images/holdout/\nnames: [car]\n"}},
       {"images/train/1", "images/holdout/2"}},
      {"lists",
       {{"", "images", "autosplit_train.txt"},
        {"val", "images", "autosplit_val.txt"},
        {"test", "images", "autosplit_test.txt"}},
       {{"data.yaml",
         "train: autosplit_train.txt\nval: autosplit_val.txt\ntest: autosplit_test.txt\n"
         "names: [car]\n"},
        {"autosplit_train.txt", "./images/1.jpg\n"},
        {"autosplit_val.txt", "./images/2.jpg\n"},
        {"autosplit_test.txt", "./images/3.jpg\n"}},
       {"images/1", "images/2", "images/3"}},
      {"by_name",
       {{"", "images", "autosplit_train.txt"}, {"val", "images", "autosplit_val.txt"}},
       {{"classes.txt", "car\n"},
        {"autosplit_train.txt", "./images/1.jpg\n"},
        {"autosplit_val.txt", "./images/2.jpg\n./images/1.jpg\n"}},
       {"images/1", "images/2", "images/3"},
       {"warning: 1 image in lists of two splits, as by_name/autosplit_*.txt says",
        "warning: 1 image left out: in no list of by_name/autosplit_*.txt"}},
      {"darknet",
       {{"", "data", "data/train.txt"}, {"test", "data", "data/test.txt"}},
       {{"data/obj.data", "classes = 1\ntrain = data/train.txt\nvalid = data/test.txt\n"},
        {"data/obj.names", "car\n"},
        {"data/train.txt", "data/obj/1.jpg\n"},
        {"data/test.txt", "data/obj/2.jpg\n"}},
       {"data/obj/1", "data/obj/2"}},
      {"one",
       {{"", "images", ""}},
       {{"data.yaml", "train: images/train\nval: images/train\nnames: [car]\n"}},
       {"images/train/1"},
       {"warning: one/data.yaml gives one/images/train two splits: it is in one, train"}}};
  for (const auto& expected : cases) {
    const fs::path root = at(expected.name);
    for (const auto& [file, content] : expected.files) write(expected.name + "/" + file, content);
    for (const std::string& image : expected.images) {
      write(expected.name + "/" + image + ".jpg");
      std::string label = image;
      if (label.starts_with("images")) label.replace(0, 6, "labels");
      write(expected.name + "/" + label + ".txt", text);
    }
    std::vector<std::array<std::string, 3>> splits;
    for (const FoundSource& source : find_sources(root)) {
      ASSERT_TRUE(source.labels) << expected.name;
      const fs::path below = source.root.lexically_relative(root);
      splits.push_back({std::string(source.split), below == "." ? "" : below.generic_string(),
                        source.ids ? source.ids->lexically_relative(root).generic_string() : ""});
    }
    EXPECT_EQ(splits, expected.splits) << expected.name;
    std::vector<std::string> remarks = find(expected.name).remarks;
    for (std::string& remark : remarks) {
      for (std::size_t i; (i = remark.find(at("").string())) != remark.npos;) {
        remark.erase(i, at("").string().size());
      }
    }
    EXPECT_EQ(remarks, expected.remarks) << expected.name;
  }
}

TEST_F(FindSource, KnowsRecordingsOfEventCameras) {
  write("ecd/events.txt");
  write("ecd/images/1.png");
  write("tables/a.csv", "t,x,y,p\n");
  write("tables/notes.txt");
  write("many/one/events.txt");
  write("many/two/events.txt");
  for (const char* root : {"ecd", "tables/a.csv", "tables", "many"}) {
    const FoundSource found = find(root);
    EXPECT_EQ(found.dataset, DatasetKind::kRecording) << root;
    EXPECT_EQ(found.root, at(root));
  }
  EXPECT_EQ(find("ecd").title, "recording of an event camera (ECD)");
  EXPECT_THAT(find("ecd").remarks, IsEmpty());
  EXPECT_EQ(find("tables").title, "recording of an event camera (table)");
  EXPECT_EQ(find("tables").columns, EventFields());
  write("microseconds/a.csv", "x,y,t_us,p\n");
  EXPECT_EQ(find("microseconds").columns.t, "t_us");
  // Numbers beside images are no events; [N, 4] of them are only if one says so.
  write("numbers/clip/1.png");
  write("numbers/boxes/a.npy", testing::npy_doubles({1, 4}, {0, 0, 1, 1}));
  EXPECT_EQ(find("numbers").dataset, DatasetKind::kFrames);
  EXPECT_EQ(find("numbers/boxes/a.npy").dataset, DatasetKind::kRecording);
  // Or their labels beside them do, if they are no labels of images.
  const std::string events = testing::npy_doubles({1, 4}, {0, 0, 1, 1});
  for (const char* name : {"windows/a", "windows/b", "yolo/labels/1", "poses/a"}) {
    write(name + std::string(".npy"), events);
  }
  write("windows/a.txt", "");
  write("windows/b.txt", "0 0.5 0.5 0.1 0.1\n");
  EXPECT_EQ(find("windows").dataset, DatasetKind::kRecording);
  write("yolo/images/1.png");
  write("yolo/labels/1.txt", "0 0.5 0.5 0.1 0.1\n");
  EXPECT_EQ(find("yolo").dataset, DatasetKind::kFrames);
  write("poses/a.txt", "hello");
  EXPECT_THROW(find("poses"), InputError);
  write("clip/1.png");
  write("clip/2.png");
  write("clip/a.csv", "t,x,y,p\n");
  EXPECT_EQ(find("clip").dataset, DatasetKind::kFrames);
}

}  // namespace
}  // namespace eventgan
