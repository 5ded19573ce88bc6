#include "stages/frames/find_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
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
    return find_source(folder_.path() / name, dataset);
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
      {"pictures", "a.PNG", DatasetKind::kFrames, ""},
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

TEST_F(FindSource, ImagesTellNoTimes) {
  write("pictures/1.png");
  EXPECT_THAT(find("pictures").remarks, Contains(HasSubstr("frames_per_second")));
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
  write("mini/other/000000.png");
  EXPECT_THAT(find("mini/other").remarks, Not(Contains(HasSubstr("a part of"))));
}

TEST_F(FindSource, SaysWhatThereIsInstead) {
  write("testing/image_2/000000.png");
  write("notes/readme.txt");
  write("pictures/1.png");
  const auto refused = [](const std::string& text) {
    return ThrowsMessage<InputError>(AllOf(HasSubstr(text), Not(HasSubstr("\n"))));
  };
  EXPECT_THAT([&] { find("notes"); }, refused("got none of these, in "));
  EXPECT_THAT([&] { find("notes/readme.txt"); }, refused("got none of these, in "));
  EXPECT_THAT([&] { find("testing"); }, refused("got none of these, in "));
  EXPECT_THAT([&] { find("absent"); }, refused("expected a folder or a video, got "));
  EXPECT_THAT([&] { find("pictures", DatasetKind::kMpii); },
              refused("expected mpii, got frames, in "));
  EXPECT_THAT([&] { find("notes", DatasetKind::kFrames); },
              refused("expected frames, got none of these, in "));
}

}  // namespace
}  // namespace eventgan
