#include "stages/frames/sources/find_source.h"

#include "manifests/values/faults.h"
#include "stages/frames/listing/image_folder.h"
#include "tests/stages/frames/sources/find_source_fixture.h"
#include "tests/testing/npy_bytes.h"

namespace eventgan {
namespace {

TEST_F(FindSource, KnowsEachDatasetByItsNames) {
  const struct {
    std::string root, file;
    DatasetKind dataset;
    std::string_view layout = "";
  } cases[] = {
      {"object", "label_2/000000.txt", kKittiObject},
      {"tracking", "label_02/0000.txt", kKittiTracking},
      {"raw", "2011_09_26/2011_09_26_drive_0001_sync/image_02/data/0000000000.png", kKittiRaw},
      {"mpii", "mpii_human_pose_v1_u12_1.mat", kMpii},
      {"mpii2", "mpii_human_pose_v1_u12_2/mpii_human_pose_v1_u12_1.mat", kMpii},
      {"fetch", "S1/Walking-1/annot.h5", kHuman36m, "fetch"},
      {"fetch2", "S11/Walking-1/imageSequence/5/img_000001.jpg", kHuman36m, "fetch"},
      {"extracted", "S1/S1_Walking_1.5/S1_Walking_1.5_000001.jpg", kHuman36m, "extracted"},
      {"official", "S1/MyPoseFeatures/D2_Positions/Walking 1.5.cdf", kHuman36m, "official"},
      {"images", "a.PNG", kFrames},
      {"folders", "clip/1.jpg", kFrames},
      {"videos", "clip.MOV", kFrames},
  };
  for (const auto& expected : cases) {
    SCOPED_TRACE(expected.root);
    write(expected.root + "/" + expected.file);
    for (const auto& dataset : {std::optional<DatasetKind>(), std::optional(expected.dataset)}) {
      const FoundSource found = find(expected.root, dataset);
      EXPECT_EQ(found.dataset, expected.dataset);
      EXPECT_EQ(found.layout, expected.layout);
      EXPECT_EQ(found.root, at(expected.root));
    }
  }
  EXPECT_EQ(find("videos/clip.MOV").dataset, kFrames);
}

TEST_F(FindSource, LooksIntoTheFolders) {
  touch({"kitti/training/label_2/000000.txt", "kitti/testing/image_2/000000.png"});
  EXPECT_EQ(find("kitti/").root, at("kitti/training"));
  write("kitti/more/S1/Walking-1/annot.h5");
  EXPECT_EQ(find("kitti", kHuman36m).root, at("kitti/more"));
  EXPECT_THROWS(find("kitti"), InputError,
                "expected one dataset, got 2: more (human36m), training (kitti_object), in ");
}

TEST_F(FindSource, KittiRawAndTheDevkitLieBesideKittiObject) {
  write("data/kitti/training/label_2/000000.txt");
  for (const char* remark : {"no devkit", "no prev_2", "no calib"}) {
    EXPECT_THAT(find("data/kitti").remarks, Contains(HasSubstr(remark)));
  }
  write("data/kitti/devkit/mapping/train_mapping.txt");
  FoundSource found = find("data/kitti");
  EXPECT_EQ(found.devkit, at("data/kitti/devkit"));
  EXPECT_EQ(found.raw_root, std::nullopt);
  EXPECT_THAT(found.remarks, Contains(HasSubstr("no raw_root")));
  touch({"data/raw/2011_09_26/2011_09_26_drive_0001_sync/image_02/data/0000000000.png",
         "data/kitti/training/prev_2/000000_01.png", "data/kitti/training/calib/000000.txt"});
  found = find("data/kitti/training");
  EXPECT_EQ(found.raw_root, at("data/raw"));
  EXPECT_THAT(found.remarks, IsEmpty());
  write("data/2011_09_28/2011_09_28_drive_0001_sync/image_02/data/0000000000.png");
  EXPECT_EQ(find("data/kitti").raw_root, at("data")) << "the days themselves";
  touch({"all/training/label_2/000000.txt",
         "all/raw/2011_09_26/2011_09_26_drive_0001_sync/image_02/data/0000000000.png"});
  EXPECT_THROWS(find("all"), InputError, "expected one dataset, got 2: raw (kitti_raw), training");
  write("all/devkit/mapping/train_mapping.txt");
  EXPECT_EQ(find("all").root, at("all/training"));
  EXPECT_EQ(find("all").raw_root, at("all/raw"));
}

TEST_F(FindSource, AListOfPeopleIsKnownByItsContent) {
  const std::string list = R"([{"image": "a.jpg", "joints": []}])";
  lay("people", "images/a.jpg, annot/valid.json=list, annot/coco.json=coco, annot/none.json=none",
      {{"list", list}, {"coco", R"({"images": []})"}, {"none", "[]"}});
  FoundSource found = find("people");
  EXPECT_EQ(found.dataset, kMpiiList);
  EXPECT_EQ(found.annotations, at("people/annot/valid.json"));
  EXPECT_THAT(found.remarks, Contains(HasSubstr("no sequences")));
  write("people/annot/train.json", list);
  write("sequences/a/1.jpg");
  found = find("people");
  EXPECT_EQ(found.annotations, at("people/annot/train.json"));
  EXPECT_EQ(found.sequences, at("sequences"));
  EXPECT_THAT(found.remarks, ElementsAre(HasSubstr("annot/valid.json")));
  write("people/mpii_human_pose_v1_u12_1.mat");
  EXPECT_EQ(find("people").dataset, kMpii) << "it has more than the list";
}

TEST_F(FindSource, VideosAreFoundByThemselvesAndInFolders) {
  write("videos/1.mp4");
  for (const char* name : {"videos", "videos/1.mp4"}) EXPECT_THAT(find(name).remarks, IsEmpty());
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
  for (const auto& [label, frames, root] : cases) {
    touch({label, frames + "/000000.png"});
    const FoundSource found = find(frames);
    EXPECT_EQ(found.root, at(frames));
    ASSERT_FALSE(found.remarks.empty()) << frames;
    EXPECT_THAT(found.remarks[0], AllOf(HasSubstr("warning: this is only a part of "),
                                        EndsWith("eventgan init \"" + at(root).string() + "\"")));
  }
  touch({"mini/label_2/000000.txt", "mini/images/000000.png"});
  EXPECT_THAT(find("mini/images").remarks.front(), EndsWith("in image_2"));
  EXPECT_EQ(find("mini").dataset, kFrames) << "its images are where KITTI has none";
  write("mini/other/000000.png");
  EXPECT_THAT(find("mini/other").remarks, Not(Contains(HasSubstr("a part of"))));
}

TEST_F(FindSource, SaysHowKittisFlowIsRead) {
  touch({"flow/image_2/000000_10.png", "flow/image_3/000000_10.png"});
  EXPECT_THAT(find("flow/image_2").remarks, IsEmpty());
  touch({"flow/flow_noc/000000_10.png"});
  EXPECT_THAT(
      find("flow/image_2").remarks,
      ElementsAre(HasSubstr(R"("flow": true and "pairs": { "gaps": [1], "side": "after" })")));
  EXPECT_THAT(find("flow/image_3").remarks, IsEmpty());
}

TEST_F(FindSource, SaysWhatThereIsInstead) {
  touch({"testing/image_2/000000.png", "notes/readme.txt", "images/1.png"});
  const struct {
    const char* name;
    std::optional<DatasetKind> dataset;
    const char* got;
  } cases[] = {
      {"notes", {}, "got none of these, in "},
      {"notes/readme.txt", {}, "got none of these, in "},
      {"testing", {}, "got none of these, in "},
      {"absent", {}, "expected a folder or a video, got "},
      {"images", kMpii, "expected MPII Human Pose (mpii), got images or videos (frames), in "},
      {"notes", kFrames, "expected images or videos (frames), got none, in "}};
  for (const auto& [name, dataset, got] : cases) {
    EXPECT_THROWS(find(name, dataset), InputError, AllOf(HasSubstr(got), Not(HasSubstr("\n"))));
  }
}

TEST_F(FindSource, SaysWhatAFileIsAndWhatToDoWithIt) {
  const struct {
    std::string name, text, title, way_out;
  } cases[] = {
      {"x.aedat", "#!AER-DAT2.0\r\n\xc0", "AEDAT of another version than 3.1 and 4.0",
       "write AEDAT4"},
      {"instances.json", R"({"images": [{"file_name": "a"}], "annotations": []})",
       "labels as COCO's", "give the folder of its images"},
      {"a.xml", "<annotation>", "XML", "give the folder"},
      {"videos.txt", "clips/a.mp4\nclips/b.mp4\n", "a list of files", "eventgan init A B"},
      {"boxes.csv", "image,class,left\n", "a table", "give the folder"},
      {"dv.csv", "ts,x,y,on\n", "a first line ts, x, y, on",
       "\"columns\" in the manifest names others"},
      {"four.csv", "0.5,1,2,9\n", "a first line 0.5, 1, 2, 9", "\"columns\" in the manifest"},
      {"matrix.npy", testing::npy_doubles({1, 3}, {1, 2, 3}), "an array not [N, 4]", "\"columns\""},
      {"drive.es", "Event Stream", "an Event Stream (.es)", "a table of t, x, y and p"},
      {"EventGAN.pt", "\x80\x02\x8a\n", "a checkpoint of PyTorch", "eventgan import-weights"},
      {"new.pt", "PK\3\4 archive/data.pkl", "a checkpoint of PyTorch", "eventgan import-weights"},
      {"a.zip", "PK\3\4 a.jpg", "an archive", "unpack it"},
      {"w.safetensors", "\x10\0\0\0\0\0\0\0{}"s, "weights", "a manifest names them"},
      {"a.jpg", "\xff\xd8\xff", "an image", "give its folder"}};
  for (const auto& [name, text, title, way_out] : cases) {
    write(name, text);
    const auto is_said = AllOf(HasSubstr("got " + title), HasSubstr("in " + at(name).string()),
                               HasSubstr(way_out), Not(HasSubstr("\n")));
    EXPECT_THAT(fault_of_file(at(name)), is_said);
    EXPECT_THROWS(find(name), InputError, is_said);
  }
  write("manifest.json", R"({"format": "eventgan-manifest", "sources": [{"annotations": "a"}]})");
  write("notes.txt", "notes");
  write("commented.json", "\n// of images, annotations\n{}");
  for (const char* name : {"manifest.json", "commented.json", "notes.txt", "nothing"}) {
    EXPECT_EQ(fault_of_file(at(name)), "") << name;
  }
}

TEST_F(FindSource, OfSeveralNamesAllWithTheLineForOneManifest) {
  for (const std::string name : {"a", "d"}) {
    touch({"data/" + name + "/label_2/000000.txt", "data/" + name + "/image_2/000000.png",
           "many/" + name + "/images/1.png"});
  }
  write("data/b/1.png");
  for (const auto& [name, got] :
       {std::pair("data", "3: a (kitti_object), b (frames), d (kitti_object)"),
        {"many", "2: a (frames), d (frames)"}}) {
    EXPECT_THROWS(find(name), InputError,
                  AllOf(HasSubstr("expected one dataset, got "s + got + ", in "),
                        HasSubstr("(one manifest of several: eventgan init \""),
                        EndsWith(" \"" + at(name / fs::path("d")).string() + "\")")));
  }
}

TEST_F(FindSource, KittisFlowIsNoPhotographs) {
  touch({"training/flow_noc/000000_10.png", "training/flow_occ/000000_10.png",
         "training/image_2/000000_10.png"});
  EXPECT_THROWS(find("training"), InputError,
                EndsWith("run eventgan convert \"" + at("training/image_2").string() + "\""));
}

TEST_F(FindSource, ImagesThatLieTooDeepAreNamed) {
  write("deep/images/train/camA/day1/1.jpg");
  write("deep/labels/train/camA/day1/1.txt", "0 .5 .5 .2 .2\n");
  write("deep/data.yaml", "names: [car]\n");
  EXPECT_THROWS(find("deep"), InputError,
                EndsWith("in " + at("deep").string() + "; images lie in images/train/camA/day1: " +
                         "run eventgan convert \"" + at("deep/images/train").string() + "\""));
  EXPECT_EQ(find("deep/images/train").labels->format, kYolo);
  touch({"fetch/S1/Walking-1/annot.h5", "fetch/S1/Walking-1/imageSequence/5/img_000001.jpg"});
  EXPECT_THROWS(find("fetch/S1"), InputError,
                AllOf(HasSubstr("this is only a part of Human3.6M"),
                      EndsWith("eventgan convert \"" + at("fetch").string() + "\"")));
  // ImageNet's videos: the labels' tree stands beside that of the images.
  write("vid/Data/VID/train/set/clip/000000.JPEG");
  write("vid/Annotations/VID/train/set/clip/000000.xml", "<annotation/>");
  EXPECT_THROWS(find("vid"), InputError, "vid/Data/VID/train\"");
  EXPECT_THAT(find("vid/Data/VID/train").unread, ElementsAre(HasSubstr("looks like Pascal VOC's")));
}

TEST_F(FindSource, HiddenFilesAndFoldersAreNoSource) {
  lay("hidden", ".cache/a.mp4", {});
  EXPECT_THROWS(find("hidden"), InputError, "got none of these");
  lay("thumbs", "annotations/1.jpg, .thumb.jpg", {});
  EXPECT_EQ(find("thumbs").dataset, kFrames);
}

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
  write("set/out/s-00000.h5");
  write("set/out/s-00000.json", R"({"format":"eventgan-commit-record"})");
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
                ThrowsMessage<UsageError>(HasSubstr(
                    "expected a folder without images or videos that eventgan did not draw")));
  }
  // A folder of images with results among them is not the program's,
  write("set/b/run.json", R"({"manifest_folder": "/a"})");
  EXPECT_THAT(sequences(), Contains("b"));
  // nor one with labels or a recording, nor one whose plan is empty.
  const auto is_hidden = [&] { return !list_image_folder(at("set")).left_out.empty(); };
  fs::remove_all(at("set/yolo"));
  EXPECT_TRUE(is_hidden());
  for (const char* name : {"set/out/labels.json", "set/out/camera.h5"}) {
    write(name, R"({"images": [{"file_name": "1.jpg"}], "annotations": []})");
    EXPECT_FALSE(is_hidden()) << name;
    fs::remove(at(name));
  }
  fs::create_directory_symlink(".", at("set/out/.again"));
  EXPECT_TRUE(is_hidden());
  write("set/out/plan.json");
  EXPECT_FALSE(is_hidden());
}

TEST_F(FindSource, ImagesThatAreLeftOutAreWarnings) {
  lay("a", "train/images/1.jpg, train/labels/1.txt, valid/images/1.jpg, data.yaml, other/2.png");
  const auto sources = find_sources(at("a"));
  ASSERT_EQ(sources.size(), 1u);
  EXPECT_EQ(sources[0].root, at("a/train/images"));
  EXPECT_THAT(sources[0].remarks, Contains("warning: 2 folders of images left out: other, valid"));
  EXPECT_THAT(find("a/train").remarks, IsEmpty());
  // One file has the labels of both.
  touch({"b/train/1.jpg", "b/val/1.jpg"});
  write("b/boxes.csv", kBoxHeader + "train/1.jpg,a,0,0,1,1\nval/1.jpg,a,0,0,1,1\n"s);
  EXPECT_EQ(find_sources(at("b")).size(), 1u);
  EXPECT_EQ(find("b").root, at("b"));
  EXPECT_THAT(find("b").remarks,
              ElementsAre(HasSubstr("warning: images of val are in split train, too")));
  // Lists of one folder have theirs apart.
  for (const std::string split : {"train", "val"}) {
    touch({"c/images/" + split + "/" + split + "1.jpg"});
    write("c/labels/" + split + "/" + split + "1.txt", "0 0.5 0.5 0.5 0.5");
    write("c/" + split + ".txt", "images/" + split + "/" + split + "1.jpg");
  }
  write("c/data.yaml", "names: [cat]\ntrain: train.txt\nval: val.txt");
  const auto lists = find_sources(at("c"));
  ASSERT_EQ(lists.size(), 2u);
  EXPECT_THAT(lists[0].remarks, Not(Contains(HasSubstr("are in split train"))));
}

TEST_F(FindSource, FoldersOfSequencesMayBeTwoDeep) {
  touch({"days/monday/a/1.jpg", "days/tuesday/b/1.jpg"});
  EXPECT_EQ(find("days").dataset, kFrames);
  EXPECT_EQ(find("days").root, at("days"));
  // A folder of datasets is none.
  touch({"sets/one/images/1.jpg", "sets/two/images/1.jpg"});
  EXPECT_THROWS(find("sets"), InputError,
                "expected one dataset, got 2: one (frames), two (frames), in ");
  // KITTI's flow: the labels are no images.
  touch({"flow/image_2/1.png", "flow/image_3/1.png", "flow/flow_occ/1.png",
         "flow/viz_flow_occ_dilate_1/1.png", "flow/disp_refl_noc/1.png"});
  EXPECT_THROWS(find("flow"), InputError,
                "expected one dataset, got 2: image_2 (frames), image_3 (frames), in ");
}

TEST_F(FindSource, KnowsRecordingsOfEventCameras) {
  touch({"ecd/events.txt", "ecd/images/1.png", "tables/notes.txt", "many/one/events.txt",
         "many/two/events.txt"});
  write("tables/a.csv", "t,x,y,p\n");
  for (const char* root : {"ecd", "tables/a.csv", "tables", "many"}) {
    EXPECT_EQ(find(root).dataset, kRecording) << root;
    EXPECT_EQ(find(root).root, at(root));
  }
  EXPECT_EQ(find("ecd").title, "recording of an event camera (ECD)");
  EXPECT_THAT(find("ecd").remarks, IsEmpty());
  EXPECT_EQ(find("tables").title, "recording of an event camera (table)");
  EXPECT_EQ(find("tables").columns, EventFields());
  write("microseconds/a.csv", "x,y,t_us,p\n");
  EXPECT_EQ(find("microseconds").columns.t, "t_us");
  write("timelens/a.csv", "timestamp,x,y,polarity\n");
  EXPECT_EQ(find("timelens").columns, (EventFields{.t = "timestamp", .p = "polarity"}));
  // Numbers beside images are no events; [N, 4] of them are only if one says so, or their labels
  // beside them do, if they are no labels of images.
  const std::string events = testing::npy_doubles({1, 4}, {0, 0, 1, 1});
  for (const char* name :
       {"numbers/boxes/a", "windows/a", "windows/b", "yolo/labels/1", "poses/a"}) {
    write(name + ".npy"s, events);
  }
  touch({"numbers/clip/1.png", "windows/a.txt", "yolo/images/1.png", "clip/1.png", "clip/2.png"});
  for (const char* name : {"windows/b.txt", "yolo/labels/1.txt"}) {
    write(name, "0 0.5 0.5 0.1 0.1\n");
  }
  write("poses/a.txt", "hello");
  write("clip/a.csv", "t,x,y,p\n");
  for (const auto& [name, dataset] : {std::pair("numbers", kFrames),
                                      {"numbers/boxes/a.npy", kRecording},
                                      {"windows", kRecording},
                                      {"yolo", kFrames},
                                      {"clip", kFrames}}) {
    EXPECT_EQ(find(name).dataset, dataset) << name;
  }
  EXPECT_THROWS(find("poses"), InputError, "got none of these, in ");
}

}  // namespace
}  // namespace eventgan
