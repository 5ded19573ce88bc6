#include "stages/frames/own_labels/find_labels.h"

#include <array>
#include <sstream>

#include "manifests/values/faults.h"
#include "tests/stages/frames/sources/find_source_fixture.h"
#include "tests/testing/npy_bytes.h"

namespace eventgan {
namespace {

using FindLabels = FindSource;  // which looks for them in the folder that it finds

const std::string kOneRow = kBoxHeader + "1.jpg,,,,,\n"s;
constexpr char kNoObjects[] = R"({"annotations": [], "images": []})";

TEST_F(FindLabels, LabelsOfOnesOwnLieBesideTheImages) {
  const std::string coco = R"({"info": {}, "images": [{"id": 1, "file_name": "1.jpg"}], )"
                           R"("annotations": [], "categories": []})";
  expect_labels(
      {{kCoco, "train2017", "annotations/instances_train2017.json",
        "train2017/1.jpg, annotations/instances_train2017.json=coco, "
        "annotations/captions_train2017.json=coco, "
        "annotations/person_keypoints_train2017.json=coco"},
       {kCoco, "images", "boxes.json", "images/1.jpg, boxes.json=coco"},
       {kCoco, "train", "train/_annotations.coco.json",
        "train/1.jpg, train/_annotations.coco.json=coco, test/2.jpg"},
       {kCoco, "", "_annotations.coco.json", "1.jpg, _annotations.coco.json=coco"},
       {kYolo, "images", "", "images/train/1.jpg, labels/train/1.txt, data.yaml"},
       {kYolo, "images", "labels", "images/1.jpg, labels/1.txt, labels/classes.txt"},
       {kYolo, "images", "", "images/1.jpg, labels/1.txt, labels/classes.txt, data.yaml=names"},
       {kYolo, "train/images", "", "train/images/1.jpg, train/labels/1.txt, data.yaml"},
       {kYolo, "", "", "1.jpg, 1.txt, classes.txt"},
       {kVoc, "JPEGImages", "Annotations",
        "JPEGImages/1.jpg, Annotations/1.xml, SegmentationClass/1.png"},
       {kVoc, "", "", "1.jpg, 1.xml"},
       {kMot, "", "", "s/img1/000001.jpg, s/gt/gt.txt"},
       {kMot, "img1", "", "img1/000001.jpg, gt/gt.txt"},
       {kMot, "images", "", "images/s/000001.jpg, s/gt.txt"},
       {kCsv, "images", "boxes.csv",
        "images/1.jpg, boxes.csv=one, others.csv=another, frames.csv=sizes"},
       {kCsv, "", "boxes.csv", "clip.mp4, boxes.csv=tracks"}},
      {{"coco", coco},
       {"names", "path: .\nnames: [x]\n"},
       {"one", kOneRow},
       {"another", kBoxHeader + "2.jpg,,,,,\n"s},
       {"sizes", "image,width\n"},
       {"tracks", "image,class,left,top,right,bottom,track\nclip/0,,,,,,\n"}});
}

TEST_F(FindLabels, LabelsLieWhereToolsPutThem) {
  const auto coco = [](const std::string& images) {
    return "\xEF\xBB\xBF\n{\"annotations\": [{\"id\": 1, \"bbox\": [1, 2, 3, 4], "
           "\"image_id\": 1}], \"categories\": [], \"images\": [" +
           images + "]}";
  };
  expect_labels(
      {{kCoco, "images/default", "annotations/instances_default.json",
        "images/default/1.jpg, annotations/instances_default.json=coco"},
       {kCoco, "val2017", "annotations/instances_val2017.json",
        "val2017/1.jpg, annotations/instances_val2017.json=coco", "val"},
       {kCoco, "images", "result.json", "images/1.jpg, result.json=label studio"},
       {kCoco, "images", "a.json", "images/\uac70 1.jpg, a.json=korean"},
       {kCoco, "images", "a.json", "images/1.jpg, a.json=outlines"},
       {kCoco, "Images", "Annotations/a.json", "Images/1.jpg, Annotations/a.json=coco"},
       {kCoco, "", "labels.json", "data/1.jpg, labels.json=coco, ._labels.json=mac"},
       {kYolo, "", "labels", "1.jpg, labels/1.txt=yolo"},
       {kYolo, "Images", "", "Images/1.jpg, Labels/1.txt, data.yaml"},
       {kYolo, "", "",
        "obj_train_data/1.jpg, obj_train_data/1.txt, obj.names=car, obj.data=classes, "
        "train.txt=list"},
       {kYolo, "", "", "clip.mp4, labels/clip_000012.txt, data.yaml"},
       {kYolo, "", "", "clip.mp4, clip/12.txt, classes.txt"},
       {kYolo, "", "labels", "clip.mp4, labels/frame_000003.txt=yolo"},
       {kYolo, "", "labels", "clip.mp4, labels/000003.txt=yolo"},
       {kYolo, "", "", "clip.mp4, obj_train_data/frame_000000.txt, obj.names=car"},
       {kVoc, "images", "annotations/xmls", "images/1.jpg, annotations/xmls/1.xml"},
       {kVoc, "images", "labels", "images/1.jpg, labels/1.xml"},
       {kVoc, "images", "xml", "images/1.jpg, xml/1.xml"},
       {kMot, "", "", "highway.mp4, highway/gt/gt.txt=mot"},
       {kMot, "", "", "highway.mp4, highway.txt=mot"},
       {kMot, "", "", "1.jpg, gt/gt.txt=mot"},
       {kCsv, "", "a.csv", "highway.mp4, a.csv=frames"},
       {kCsv, "train", "train/_annotations.csv", "train/1.jpg, train/_annotations.csv=roboflow"}},
      {{"coco", coco(R"({"file_name": "1.jpg", "id": 1})")},
       {"label studio", coco(R"({"file_name": "images\/1\/1.jpg"})")},
       {"outlines", R"({"images": [{"id": 1, "file_name": "1.jpg"}], "annotations": [{"id": 1, )"
                    R"("image_id": 1, "category_id": 1, "segmentation": []}]})"},
       {"korean", coco(R"({"file_name": "\uac70 1.jpg"})")},
       {"mac", "Mac"},
       {"yolo", "\xEF\xBB\xBF\n1 0.5 0.5 0.25 0.5\n"},
       {"car", "car"},
       {"classes", "classes = 1"},
       {"list", "data/obj_train_data/1.jpg"},
       {"mot", "1,1,1,1,2,2,1,1,1\n"},
       {"frames", "frame;label;x;y;w;h\nhighway.mp4/12;car;1;2;3;4\n"},
       {"roboflow", "filename,width,height,class,xmin,ymin,xmax,ymax\n1.jpg,9,9,car,1,2,3,4\n"}});
}

TEST_F(FindLabels, WhatLooksLikeLabelsAndIsNotReadIsNamed) {
  const struct {
    std::string title, images, labels, text, more = "", more_text = "";
  } cases[] = {
      {"CVAT's XML", "images/1.jpg", "annotations.xml",
       "<annotations><image id=\"0\"/></annotations>"},
      {"labelme's", "1.jpg", "1.json", R"({"shapes": [], "imagePath": "1.jpg"})"},
      {"CreateML's", "train/1.jpg", "train/_annotations.createml.json",
       R"([{"image": "1.jpg", "annotations": [{"label": "car", "coordinates": {"x": 1}}]}])"},
      {"Label Studio's", "images/1.jpg", "project.json",
       R"([{"id": 1, "data": {}, "annotations": []}])"},
      {"YOLO", "images/a/1.jpg, images/b/2.jpg", "labels/2.txt", "0 .5 .5 .2 .2\n"},
      {"VisDrone's", "images/1.jpg", "annotations/1.txt", "684,8,273,116,0,0,0,0\n"},
      {"KITTI's", "images/1.jpg", "label_2/1.txt",
       "Car 0.00 0 -1.58 587 173 614 200 1.65 1.67 3.64 -0.65 1.71 46.70 -1.59\n"},
      {"COCO", "images/1.jpg", "a.json",
       R"({"images": [{"file_name": "gone.jpg"}], "annotations": [{"bbox": []}]})"},
      {"a table of", "1.jpg", "a.csv", "1.jpg,1,2,3,4,car\n"},
      {"a table of", "00000.ppm", "gt.txt", "00000.ppm;774;411;815;446;11\n"},
      {"a table of", "train/b6ab.jpg", "train.csv",
       "image_id,width,height,bbox,source\nb6ab,9,9,\"[1.0, 2, 3, 4]\",usask\n"},
      {"Open Images'", "train/0a1b.jpg", "boxes.csv",
       "ImageID,Source,LabelName,Confidence,XMin,XMax,YMin,YMax\n"
       "0a1b,xclick,/m/0k4j,1,0.1,0.2,0.3,0.4\n"},
      {"BDD100K's", "images/100k/train/f-1.jpg", "labels/det_20/det_train.json",
       R"([{"name": "f-1.jpg"}, {"name": "f-2.jpg", "labels": [{"box2d": {"x1": 1}}]}])"},
      {"Supervisely's", "ds/img/im.jpg", "ds/ann/im.jpg.json",
       R"({"tags": [], "size": {"height": 9}, "objects": []})", "meta.json",
       R"({"classes": [], "tags": []})"},
      {"DOTA's", "train/images/P1.png", "train/labelTxt-v1.0/P1.txt",
       "imagesource:GoogleEarth\ngsd:0.1\n1 1 5 1 5 5 1 5 plane 0\n"},
      {"PoseTrack's", "images/val/000342_mpii/000000.jpg", "annotations/val/000342_mpii.json",
       R"({"images": [{"file_name": "images/val/000342_mpii/000000.jpg"}],)"
       R"( "annotations": [{"bbox": [1, 2, 3, 4], "keypoints": []}]})"},
      {"UA-DETRAC's", "MVI_20011/img00001.jpg", "MVI_20011.xml",
       "<sequence name=\"MVI_20011\"><frame num=\"1\"><target_list/>"},
      {"GOT-10k's or LaSOT's", "GOT_1/00000001.jpg", "GOT_1/groundtruth.txt", "1.0,2.0,3.0,4.0\n"},
      {"UAVDT's", "M0101/img000001.jpg", "M0101_gt_whole.txt", "1,1,1,2,3,4,1,1,1\n"},
      {"CrowdHuman's", "Images/273271,c9db.jpg", "a.odgt",
       R"({"ID": "273271,c9db", "gtboxes": [{"fbox": [1, 2, 3, 4]}]})"},
      {"LVIS's", "images/000000397133.jpg", "lvis.json",
       R"({"images": [{"id": 1, "coco_url": "http://x/train2017/000000397133.jpg"}],)"
       R"( "annotations": [{"bbox": [1, 2, 3, 4]}]})"},
      {"YouTube-VIS's", "JPEGImages/0a1/00000.jpg", "instances.json",
       R"({"videos": [{"file_names": ["0a1/00000.jpg"]}], "annotations": [{"bboxes": []}]})"},
      {"nuImages'", "samples/CAM/n003.jpg", "v1.0-mini/object_ann.json",
       R"([{"token": "a", "category_token": "b", "bbox": [1]}])"},
      {"AI Challenger's", "images/70b1.jpg", "a.json",
       R"([{"image_id": "70b1", "human_annotations": {"human1": [1, 2, 3, 4]}}])"},
      {"SoccerNet's", "img1/000001.jpg", "Labels-GameState.json",
       R"({"images": [{"file_name": "000001.jpg"}], "annotations": [{"bbox_image": {"x": 1}}]})"},
      {"a table of", "run.mp4, walk.mp4", "boxes.csv",
       "frame,class,left,top,right,bottom\n0,car,1,2,3,4\n"},
      {"a table of", "images/1.jpg", "boxes.csv",
       "image,class,left,top,right,bottom\nphoto_1.jpg,car,1,2,3,4\n"},
      {"a table of", "1.jpg", "boxes.csv", "image,x1,y1,x2,y2,text\nother.jpg,1,2,3,4,a\n"},
      {"MOT's", "run.mp4, walk.mp4", "gt/run.txt", "1,1,10,20,30,40,1,1,1\n"},
      {"a table of", "1.jpg", "a.csv",
       "image,class,left,top,right,bottom,score\n1.jpg,a,0,0,1,1,1\n"}};
  int number = 0;
  for (const auto& one : cases) {
    const std::string name = "unread" + std::to_string(number++);
    SCOPED_TRACE(one.title + " " + name);
    lay(name, one.images);
    write(fs::path(name) / one.labels, one.text);
    if (!one.more.empty()) write(fs::path(name) / one.more, one.more_text);
    const FoundSource found = find(name);
    EXPECT_EQ(found.dataset, kFrames);
    EXPECT_FALSE(found.labels);
    EXPECT_THAT(found.unread,
                ElementsAre(AllOf(StartsWith(at(name).string()),
                                  HasSubstr(" looks like " + one.title +
                                            " labels of these images and is not read: "),
                                  HasSubstr("; "))));
  }
  EXPECT_THAT(find("unread" + std::to_string(number - 1)).unread.front(),
              HasSubstr("it has a column of scores"));
  EXPECT_THAT(find("unread6").unread.front(), HasSubstr("if the classes are not KITTI's"));
  write("board/score.jpg");  // a name that says score, in a table without a header
  write("board/mine.csv", "score.jpg,car,0,0,9,9\n");
  EXPECT_THAT(find("board").unread, ElementsAre(::testing::Not(HasSubstr("column of scores"))));
  lay("none", "1.jpg, 1.txt=caption, captions.json=captions, frames.csv=frames, 1.json=mine",
      {{"caption", "a street with two cars\n"},
       {"captions", R"([{"image": "1.jpg", "caption": "a street"}])"},
       {"frames", "image,width,height,sequence,index\n1.jpg,64,48,a,1\n"},
       {"mine", R"({"mine": [1, 2]})"}});
  EXPECT_THAT(find("none").unread, IsEmpty());
}

/// Whatever tool wrote it: by the images that it names, its own name, or its place.
TEST_F(FindLabels, WhatNamesTheImagesAndIsNotReadIsNamed) {
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
    SCOPED_TRACE(file);
    const std::string name = "named" + std::to_string(number++) + "/set";
    write(name + "/clip/im1.jpg");
    write(name + "/" + file, text);
    const std::string place = at(name + "/" + file).lexically_normal().string();
    EXPECT_THAT(
        find(name).unread,
        ElementsAre(AllOf(StartsWith(place), HasSubstr(" is not read: no reader of its format"))));
    EXPECT_THAT(find(name).remarks, IsEmpty());
    // With labels it is a remark.
    write(name + "/b.csv", kBoxHeader + "im1.jpg,a,0,0,1,1\n"s);
    const FoundSource labelled = find(name);
    EXPECT_TRUE(labelled.labels);
    EXPECT_THAT(labelled.unread, IsEmpty());
    EXPECT_THAT(labelled.remarks,
                ElementsAre("1 file with names of these images not read: " + place));
  }
  // Of single images not all are looked at.
  write("many/b.csv", kBoxHeader + "im1.jpg,a,0,0,1,1\n"s);
  Texts places;
  for (const std::string name : {"im1", "im2", "im3", "im4", "im5"}) {
    write("many/images/" + name + ".jpg");
    write("many/more/" + name + ".txt", name + " 4 5 9 9\n");
    places.push_back(at("many/more/" + name + ".txt").string());
  }
  EXPECT_THAT(find("many").remarks,
              ElementsAre("3 or more files with names of these images not read: " + places[0] +
                          ", " + places[1] + ", " + places[2]));
}

TEST_F(FindLabels, FilesOfLabelsThatCannotBeReadAreNamed) {
  write("gone/im1.jpg");
  fs::create_symlink(at("nowhere.csv"), at("gone/boxes.csv"));
  EXPECT_THAT(find("gone").unread, ElementsAre(at("gone/boxes.csv").string() +
                                               " is not read: No such file or directory"));
  for (const std::string name : {"boxes.csv", "annotations/instances.json"}) {
    const std::string set = "empty_" + fs::path(name).stem().string();
    write(set + "/images/im1.jpg");
    write(set + "/" + name, "");
    EXPECT_THAT(find(set).unread,
                ElementsAre(at(set + "/" + name).string() + " is not read: it is empty"));
  }
  write("texts/im1.jpg");
  write("texts/notes.txt", "");
  EXPECT_THAT(find("texts").unread, IsEmpty());
  write("texts/set/im2.jpg");
  write("texts/beside.csv", "");  // another's, above what is given
  EXPECT_THAT(find("texts/set").unread, IsEmpty());

  write("cut/im1.jpg");
  write("cut/all.json",
        R"({"images": [{"id": 1, "file_name": "im1.jpg", "size": [1, 2, 3, 4], "da)");
  EXPECT_THAT(find("cut").unread,
              ElementsAre(at("cut/all.json").string() +
                          " names these images and is not read: it ends before its JSON does"));
  write("wide/im1.jpg");
  std::string wide = "\xFF\xFE";  // as Excel saves "Unicode text"
  for (const char letter : kBoxHeader + "im1.jpg,a,1,2,3,4\n"s) wide += {letter, '\0'};
  write("wide/boxes.csv", wide);
  EXPECT_THAT(find("wide").unread, ElementsAre(at("wide/boxes.csv").string() +
                                               " is UTF-16, and is not read: save it as UTF-8"));
  write("listed/im1.jpg");
  std::string list = "\xFF\xFE";  // as PowerShell writes a folder's names
  for (const char letter : "im1.jpg\r\n"s) list += {letter, '\0'};
  write("listed/list.txt", list);
  EXPECT_THAT(find("listed").unread, IsEmpty());
  write("own/im1.jpg");
  write("own/im1.json", "");  // an image's own, which is passed through
  write("own/values.npy", "");
  EXPECT_THAT(find("own").unread, IsEmpty());
  write("beside/images/im1.jpg");
  write("beside/annotations/all.json", "");
  EXPECT_THAT(find("beside/images").unread, ElementsAre(at("beside/annotations/all.json").string() +
                                                        " is not read: it is empty"));
}

TEST_F(FindLabels, WhatNamesTheImagesAndIsNoLabelStopsNothing) {
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
      {"manifest.json",
       "{\n  \"format\": \"eventgan-manifest\",  // by init\n \"root\": \"IMG_0001.jpg\", \"n\": "
       "[1, 2, 3]}"},
      {"other.json", R"({"of": "IMG_0003.jpg", "at": [1, 2, 3, 4]})"}};
  for (const auto& [file, text] : files) write("quiet/" + file, text);
  write("quiet/IMG_0001.jpg");
  EXPECT_THAT(find("quiet").unread, IsEmpty());
  EXPECT_THAT(find("quiet").remarks, IsEmpty());
  write("quiet/captions.txt", "IMG_0001.jpg two dogs\n");
  EXPECT_THAT(find("quiet").unread, IsEmpty());
  EXPECT_THAT(find("quiet").remarks, ElementsAre("1 file with names of these images not read: " +
                                                 at("quiet/captions.txt").string()));
  write("quiet/sets/other/images/IMG_0002.jpg");  // another dataset
  write("quiet/sets/other/boxes.json", R"({"of": "IMG_0001.jpg", "at": [1, 2, 3, 4]})");
  EXPECT_THAT(find("quiet").unread, IsEmpty());
}

TEST_F(FindLabels, LabelsBesideThatNameOtherImagesAreOfAnotherDataset) {
  write("set/images/im1.jpg");
  const auto labelme = [](const std::string& image) {
    return R"({"shapes": [], "imagePath": ")" + image + R"("})";
  };
  write("set/annotations/im7.json", labelme("im7.jpg"));
  write("set/all.json", R"({"images": [{"file_name": "im7.jpg"}], "annotations": []})");
  EXPECT_THAT(find("set/images").unread, IsEmpty());
  EXPECT_THAT(find("set").unread, SizeIs(2)) << "whoever gives their folder may mean them";
  write("set/annotations/two.json", labelme("im1.jpg"));
  EXPECT_THAT(find("set/images").unread, ElementsAre(HasSubstr("two.json looks like labelme")));
}

TEST_F(FindLabels, TextsBesideTheImagesAreTakenWhereTheReaderLooks) {
  touch({"a/imgs/1.jpg", "a/imgs/1.txt", "a/data.yaml"});
  EXPECT_EQ(find("a/imgs").labels->path, at("a/imgs")) << "a has neither labels nor these texts";
}

TEST_F(FindLabels, ADatasetsYamlGoesBeforeTextsInIt) {
  touch({"all/a/images/1.jpg", "all/a/labels/1.txt", "all/a/labels/classes.txt"});
  write("all/other.yaml", "names: [x]");  // of another dataset, as far as anybody knows
  EXPECT_EQ(find("all/a").labels->path, at("all/a/labels"));
  write("all/data.yaml", "names: [x]");
  EXPECT_EQ(find("all/a").labels->path, at("all/a/labels"));
  write("all/a/data.yaml", "train: images");  // which names no classes
  EXPECT_EQ(find("all/a").labels->path, at("all/a/labels"));
  write("all/a/data.yaml", "names: [x]");
  EXPECT_EQ(find("all/a").labels->path, at("all/a"));
  touch({"set/train/images/1.jpg", "set/train/labels/1.txt", "set/train/labels/classes.txt"});
  write("set/data.yaml", "names: [x]");
  EXPECT_EQ(find("set").labels->path, at("set"));
}

TEST_F(FindLabels, LabelsThatAreLeftOutAreRemarks) {
  touch({"a/images/1.jpg", "a/labels/1.txt"});
  FoundSource found = find("a");
  EXPECT_FALSE(found.labels);
  EXPECT_EQ(found.root, at("a"));
  EXPECT_THAT(found.remarks, Contains(HasSubstr("no data.yaml or classes.txt")));
  write("a/data.yaml");
  write("a/boxes.csv", kOneRow);
  found = find("a");
  EXPECT_EQ(found.labels->format, kYolo);
  EXPECT_THAT(found.remarks, Contains(HasSubstr("labels in another format (csv) left out: " +
                                                at("a/boxes.csv").string())));
  touch({"c/train2017/1.jpg", "c/val2017/1.jpg"});
  write("c/annotations/instances_train2017.json", kNoObjects);
  write("c/annotations/instances_val2017.json", R"({"images": [{"file_name": "gone.jpg"}]})");
  found = find("c");
  EXPECT_EQ(found.root, at("c/train2017"));
  EXPECT_EQ(found.labels->path, at("c/annotations/instances_train2017.json"));
  lay("d", "1.jpg, 1.json=none, other.json=other, table.csv=table, notes.txt",
      {{"none", R"({"images": "none"})"},
       {"other", R"({"images": [{"file_name": "2.jpg"}]})"},
       {"table", "image,class\n"}});
  EXPECT_FALSE(find("d").labels);
  write("d/near.csv", "image,class,left,top,right,bottom,score\n1.jpg,a,0,0,1,1,1\n");
  found = find("d");
  EXPECT_FALSE(found.labels);
  EXPECT_THAT(found.remarks,
              Contains(AllOf(HasSubstr("a table left out, expected columns image, class, "),
                             HasSubstr("got \"score\": " + at("d/near.csv").string()))));
}

TEST_F(FindLabels, TextsBesideTheImagesAndInLabelsAreOfTheSame) {
  const std::string text = "0 .5 .5 .2 .2\n";
  lay("y", "images/1.jpg, images/1.txt=text, labels/1.txt=text", {{"text", text}});
  EXPECT_EQ(find("y").labels->path, at("y/labels"));
  EXPECT_THAT(find("y").remarks, IsEmpty());
}

TEST_F(FindLabels, TextsOfImagesAboveAreOfOthers) {
  const std::string text = "0 .5 .5 .2 .2\n";
  lay("above", "1.jpg, 1.txt=text, images/11.jpg, images/11.txt=text", {{"text", text}});
  EXPECT_THAT(find("above").remarks, Contains(HasSubstr("labels of other images left out")));
}

TEST_F(FindLabels, LabelsOfAnotherVideoAreNotTaken) {
  lay("h", "a/walk.mp4, b/walk.mp4, boxes.csv=table", {{"table", kBoxHeader + "a/walk/0,,,,,\n"s}});
  EXPECT_EQ(find("h/a").labels->path, at("h/boxes.csv"));
  EXPECT_FALSE(find("h/b").labels);
  EXPECT_THAT(find("h/b").unread, ElementsAre(HasSubstr("none of the images it names is here")));
}

TEST_F(FindLabels, NamesOfClassesGoBeforeYolosNumbers) {
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
  write("a/images/2.jpg");
  write("a/labels/2.txt");  // of all images there are texts alone: the remark says where names are
  expect(LabelFormat::kYolo, "voc");
  EXPECT_THAT(find("a").remarks, Contains(HasSubstr("has the names of the classes")));
  write("a/classes.txt", "walker\n");
  expect(LabelFormat::kYolo, "voc");
  fs::remove_all(at("a/xml"));
  write("a/boxes.csv", "image,class,left,top,right,bottom\n1.jpg,walker,0,0,1,1\n");
  expect(LabelFormat::kYolo, "csv");
  fs::remove(at("a/classes.txt"));
  EXPECT_THAT(find("a").remarks, Contains(HasSubstr("has the names of the classes")));
}

/// Among or beside images, what the program has made is neither image nor label nor recording.
TEST_F(FindLabels, ListsOfSplitsAreNamed) {
  touch({"voc/JPEGImages/1.jpg", "voc/Annotations/1.xml"});
  write("voc/ImageSets/Main/train.txt", "1\n");
  write("voc/ImageSets/Main/car_train.txt", "1 1\n");
  EXPECT_THAT(
      find("voc").remarks,
      ElementsAre("warning: 1 list of a split not used in " + at("voc/ImageSets/Main").string() +
                  ": train.txt; give each split its own source with \"ids\", a sample id a "
                  "line"));
  touch({"flat/test.jpg", "flat/test.txt"});  // has a label so called
  EXPECT_THAT(find("flat").remarks, Not(Contains(HasSubstr("of a split"))));
}

TEST_F(FindLabels, ASplitsImagesMayHaveLabelsOfAnyFormatBesideThem) {
  const std::string coco = R"({"images": [{"id": 1, "file_name": "1.jpg"}], "annotations": []})";
  for (const std::string split : {"train", "val"}) {
    lay("voc/" + split, "images/1.jpg, annotations/1.xml");
    lay("coco/" + split, "images/1.jpg, annotations.json=coco", {{"coco", coco}});
  }
  for (const std::string name : {"voc", "coco"}) {
    const auto sources = find_sources(at(name));
    ASSERT_EQ(sources.size(), 2u) << name;
    for (const FoundSource& source : sources) {
      const std::string split = source.split.empty() ? "train" : std::string(source.split);
      EXPECT_THAT(source.root.string(), StartsWith((at(name) / split).string()));
      ASSERT_TRUE(source.labels) << source.root;
      EXPECT_THAT(source.labels->path.string(), HasSubstr(split + "/annotations"));
    }
    EXPECT_EQ(sources[1].split, "val");
  }
}

TEST_F(FindLabels, SplitsWithLabelsOfTheirOwnAreSources) {
  /// "SPLIT: ROOT, LABELS" of each.
  const auto splits = [&](const fs::path& name) {
    Texts found;
    for (const FoundSource& source : find_sources(at(name))) {
      found.push_back(std::string(source.split) + ": " + below(source.root, name).generic_string() +
                      ", " + below(source.labels->path, name).generic_string());
    }
    return found;
  };
  for (const std::string split : {"valid", "train", "test"}) {
    lay("roboflow/" + split, "images/1.jpg, labels/1.txt");
    write("yolo/images/" + split + "/1.jpg");
    if (split != "test") write("yolo/labels/" + split + "/1.txt");
    lay("voc/" + split, "1.jpg, 1.xml");
  }
  for (const std::string folder : {"caps/Training", "caps/VAL", "dev/train", "dev/dev"}) {
    lay(folder, "1.jpg, 1.xml");
  }
  EXPECT_THAT(splits("caps"), ElementsAre(": Training, Training", "val: VAL, VAL"));
  EXPECT_THAT(splits("dev"), ElementsAre(": train, train", "val: dev, dev"));
  write("roboflow/data.yaml");
  EXPECT_THAT(splits("roboflow"),
              ElementsAre(": train/images, .", "val: valid/images, .", "test: test/images, ."));
  EXPECT_THAT(find("roboflow").remarks, IsEmpty());
  write("yolo/data.yaml");
  EXPECT_THAT(splits("yolo"), ElementsAre(": images/train, .", "val: images/valid, ."));
  EXPECT_THAT(find("yolo").remarks,
              ElementsAre("warning: 1 folder of images left out: images/test"));
  EXPECT_EQ(splits("yolo/images").size(), 2u);
  EXPECT_THAT(splits("voc"),
              ElementsAre(": train, train", "val: valid, valid", "test: test, test"));
  for (const std::string split : {"train2017", "val2017"}) {
    write("coco/" + split + "/1.jpg");
    write("coco/annotations/instances_" + split + ".json", kNoObjects);
  }
  EXPECT_THAT(splits("coco"), ElementsAre(": train2017, annotations/instances_train2017.json",
                                          "val: val2017, annotations/instances_val2017.json"));
  // Other images of the folder would be lost.
  touch({"yolo/images/more/1.jpg", "yolo/labels/more/1.txt"});
  EXPECT_THAT(splits("yolo"), ElementsAre(": images, ."));
  // A folder that was asked for is its split alone.
  EXPECT_THAT(splits("voc/valid"), ElementsAre(": ., ."));
}

TEST_F(FindLabels, FilesWithLabelsOfOtherImagesAreSources) {
  const auto found = [&](const std::string& name, const std::string& files) {
    lay(name, "images/1.jpg, images/2.jpg, " + files,
        {{"1", kOneRow},
         {"2", kBoxHeader + "2.jpg,,,,,\n"s},
         {"both", kOneRow + "2.jpg,,,,,\n"},
         {"late", kBoxHeader +
                      [] {
                        std::string others;  // more than a look at the beginning shows
                        while (others.size() < 1 << 17)
                          others += "another" + others.substr(0, 99) + ".jpg,,,,,\n";
                        return others;
                      }() +
                      "2.jpg,,,,,\n"},
         {"coco 1", R"({"images": [{"id": 1, "file_name": "1.jpg"}], "annotations": []})"},
         {"coco 2", R"({"images": [{"id": 7, "file_name": "2.jpg"}], "annotations": []})"}});
    std::string all;
    for (const FoundSource& source : find_sources(at(name))) {
      all += std::string(source.split) + ": " + source.labels->path.filename().string() + "; ";
      for (const std::string& unread : source.unread) {
        EXPECT_THAT(unread, StartsWith(at(name).string()));
        const std::size_t again = unread.find(" labels images");
        if (again != unread.npos) all += unread.substr(again, 40);
      }
      for (const std::string& remark : source.remarks) all += remark.substr(0, 27);
    }
    return all;
  };
  EXPECT_EQ(found("parts", "part1.csv=1, part2.csv=2"), ": part1.csv; : part2.csv; ");
  EXPECT_EQ(found("splits", "train.csv=1, val.csv=2"), ": train.csv; val: val.csv; ");
  EXPECT_EQ(found("test", "boxes-test.csv=1, boxes-train.csv=2"),
            ": boxes-train.csv; test: boxes-test.csv; ");
  EXPECT_EQ(found("late", "a.csv=1, b.csv=late"), ": a.csv; : b.csv; ");
  EXPECT_EQ(found("alone", "b.csv=late"), ": b.csv; ");
  EXPECT_EQ(found("three", "a.csv=1, b.csv=2, c.csv=2"),
            ": a.csv;  labels images that b.csv labels, too, a: b.csv; ");
  EXPECT_EQ(found("own", "1.csv=1, 2.csv=2, all.csv=both"),
            ": all.csv; 2 files with names of these")
      << "each image's own";
  EXPECT_EQ(found("coco",
                  "annotations/instances_train.json=coco 1, "
                  "annotations/instances_val.json=coco 2"),
            ": instances_train.json; val: instances_val.json; ");
  EXPECT_EQ(found("some", "cars.csv=both, persons.csv=2"),
            ": cars.csv;  labels images that cars.csv labels, too");
  EXPECT_EQ(found("kinds", "cars.json=coco 1, persons.json=coco 1"),
            ": cars.json;  labels images that cars.json labels, to");
  EXPECT_EQ(found("people", "instances_a.json=coco 1, person_keypoints_a.json=coco 1"),
            ": instances_a.json; other COCO labels left out:");
  EXPECT_EQ(found("flat",
                  "instances_train.json=coco 1, instances_val.json=coco 2, "
                  "person_keypoints_val.json=coco 2, coco_val_v1.0.json=coco 2"),
            ": instances_train.json; other COCO labels left out:other COCO labels left out:"
            "val: instances_val.json; ");
  std::string many = "a0.csv=1";
  for (int i = 1; i < 9; ++i) many += ", a" + std::to_string(i) + ".csv=2";
  EXPECT_EQ(found("many", many), ": a0.csv; ");
  EXPECT_THAT(find("many").unread,
              ElementsAre(HasSubstr("a1.csv, as 7 other files, labels these images, too")));
}

TEST_F(FindLabels, SplitsAreAsTheDatasetSays) {
  const struct {
    std::string name, splits;  ///< "SPLIT ROOT LIST; ..." as they are found
    std::string images, files;
    std::map<std::string, std::string> texts;
    Texts remarks = {};
  } cases[] = {
      {"folders",
       " images/a ; images/b ;val images/c ;",
       "images/a/1 images/b/2 images/c/3",
       "data.yaml=yaml",
       {{"yaml", "path: .\ntrain:\n  - images/a\n  - images/b\nval: images/c\nnames: [car]\n"}}},
      {"holdout",
       " images/train ;val images/holdout ;",
       "images/train/1 images/holdout/2",
       "own.yaml=yaml",
       {{"yaml", "train: ../x/images/train\nval: /elsewhere/images/holdout/\nnames: [car]\n"}}},
      {"lists",
       " images autosplit_train.txt;val images autosplit_val.txt;test images autosplit_test.txt;",
       "images/1 images/2 images/3",
       "data.yaml=yaml, autosplit_train.txt=1, autosplit_val.txt=2, autosplit_test.txt=3",
       {{"yaml",
         "train: autosplit_train.txt\nval: autosplit_val.txt\ntest: autosplit_test.txt\n"
         "names: [car]\n"},
        {"1", "./images/1.jpg\n"},
        {"2", "./images/2.jpg\n"},
        {"3", "./images/3.jpg\n"}}},
      {"by_name",
       " images autosplit_train.txt;val images autosplit_val.txt;",
       "images/1 images/2 images/3",
       "classes.txt=car, autosplit_train.txt=1, autosplit_val.txt=2 and 1",
       {{"car", "car\n"},
        {"1", "./images/1.jpg\n"},
        {"2 and 1", "images\\2.jpg\n../by_name/images/1.jpg\n"}},
       {"warning: 1 image in lists of two splits, as by_name/autosplit_*.txt says",
        "warning: 1 image left out: in no list of by_name/autosplit_*.txt"}},
      {"darknet",
       " data data/train.txt;test data data/test.txt;",
       "data/obj/1 data/obj/2",
       "data/obj.data=data, data/obj.names=car, data/train.txt=1, data/test.txt=2",
       {{"data", "classes = 1\ntrain = data/train.txt\nvalid = data/test.txt\n"},
        {"car", "car\n"},
        {"1", "data/obj/1.jpg\n"},
        {"2", "data/obj/2.jpg\n"}}},
      {"gone",
       " images ;",
       "images/1",
       "data.yaml=yaml",
       {{"yaml", "train: train.txt\nval: val.txt\nnames: [car]\n"}},
       {"warning: 2 lists of gone/data.yaml not there: train.txt, val.txt"}},
      {"one",
       " images ;",
       "images/train/1",
       "data.yaml=yaml",
       {{"yaml", "train: images/train\nval: images/train\nnames: [car]\n"}},
       {"warning: one/data.yaml gives one/images/train two splits: it is in one, train"}}};
  for (const auto& [name, splits, images, files, texts, remarks] : cases) {
    SCOPED_TRACE(name);
    lay(name, files, texts);
    std::istringstream each(images);
    for (std::string image; each >> image;) {
      write(name + "/" + image + ".jpg");
      if (image.starts_with("images")) image.replace(0, 6, "labels");
      write(name + "/" + image + ".txt", "0 .5 .5 .2 .2\n");
    }
    std::string found;
    for (const FoundSource& source : find_sources(at(name))) {
      ASSERT_TRUE(source.labels);
      const fs::path root = below(source.root, name);
      found += std::string(source.split) + " " + (root == "." ? "" : root.generic_string()) + " " +
               (source.ids ? below(*source.ids, name).generic_string() : "") + ";";
    }
    EXPECT_EQ(found, splits);
    Texts told = find(name).remarks;
    for (std::string& remark : told) {
      for (std::size_t i; (i = remark.find(at("").string())) != remark.npos;) {
        remark.erase(i, at("").string().size());
      }
    }
    EXPECT_EQ(told, remarks);
  }
}

}  // namespace
}  // namespace eventgan
