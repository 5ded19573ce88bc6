#include "stages/frames/mpii/mpii_frames.h"

#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

class MpiiPlacesTest : public FolderTest {
 protected:
  MpiiPlacesTest() { spec_.root = "m"; }
  MpiiPlaces find() const { return find_mpii_places(spec_, folder_.path()); }

  const std::string keyframes_ = "mpii_human_pose_v1_sequences_keyframes.mat";
  SourceSpec spec_;
};

TEST_F(MpiiPlacesTest, FindsTheFilesInTheRoot) {
  touch({"m/mpii_human_pose_v1_u12_1.mat", "m/" + keyframes_,
         "m/mpii_human_pose_v1_sequences_batch2/x/1.jpg",
         "m/mpii_human_pose_v1_sequences_batch1/y/1.jpg"});
  const MpiiPlaces places = find();
  EXPECT_EQ(places.annotations, "m/mpii_human_pose_v1_u12_1.mat");
  EXPECT_EQ(places.keyframes, "m/" + keyframes_);
  EXPECT_THAT(places.image_folders, ElementsAre("m/images"));
  EXPECT_THAT(places.sequence_folders,
              ElementsAre("m/sequences", "m/mpii_human_pose_v1_sequences_batch1",
                          "m/mpii_human_pose_v1_sequences_batch2"));
}

TEST_F(MpiiPlacesTest, FindsTheFilesInTheDownloadsFolder) {
  touch({"m/mpii_human_pose_v1_u12_2/mpii_human_pose_v1_u12_1.mat", "m/" + keyframes_});
  EXPECT_EQ(find().annotations, "m/mpii_human_pose_v1_u12_2/mpii_human_pose_v1_u12_1.mat");
  EXPECT_EQ(find().keyframes, "m/" + keyframes_);
}

TEST_F(MpiiPlacesTest, TakesTheManifestsWord) {
  touch({"m/x", "labels/mine.mat", "labels/" + keyframes_, "videos/x/1.jpg"});
  spec_.annotations = "labels/mine.mat";
  spec_.sequences = "videos";
  EXPECT_EQ(find().annotations, "labels/mine.mat");
  EXPECT_EQ(find().keyframes, "labels/" + keyframes_);
  EXPECT_THAT(find().sequence_folders, ElementsAre("videos"));
}

TEST_F(MpiiPlacesTest, SaysWhatIsMissing) {
  EXPECT_THROWS(find(), InputError, "expected a folder, got nothing that can be read, in m");
  write("m/x");
  EXPECT_THROWS(find(), InputError, "expected mpii_human_pose_v1_u12_1.mat, got none", "m or ",
                "mpii_human_pose_v1_u12_2");
  write("m/mpii_human_pose_v1_u12_1.mat");
  EXPECT_EQ(find().keyframes, "") << "there are no sequences";
  write("m/sequences/x/1.jpg");
  EXPECT_THROWS(find(), InputError, "expected " + keyframes_);
  spec_.pairs.stills.emplace();
  EXPECT_EQ(find().keyframes, "") << "stills need none";
  spec_.pairs.stills.reset();
  write("m/" + keyframes_);
  spec_.sequences = "videos";
  EXPECT_THROWS(find(), InputError, "videos");
}

TEST(SameBytes, ComparesSizeAndContent) {
  const TemporaryFolder folder;
  for (const auto& [name, bytes] : {std::pair("a", "x\0y"s),
                                    {"same", "x\0y"s},
                                    {"other", "x\0z"s},
                                    {"longer", "x\0yy"s},
                                    {"empty", ""s}}) {
    write_file(folder / name, bytes);
  }
  for (const auto& [first, second, same] : {std::tuple("a", "same", true),
                                            {"empty", "empty", true},
                                            {"a", "other", false},
                                            {"a", "longer", false},
                                            {"a", "absent", false},
                                            {"absent", "absent", false}}) {
    EXPECT_EQ(same_bytes(folder / first, folder / second), same) << first << " " << second;
  }
}

/// Images a, b; sequence a with frames 5, 6, 7, 9 and keyframe 7; sequence c in a batch folder.
class MpiiFramesTest : public FolderTest {
 protected:
  MpiiFramesTest() {
    for (const char* name :
         {"m/images/a.jpg", "m/images/b.jpg", "m/sequences/a/00000005.jpg",
          "m/sequences/a/00000006.jpg", "m/sequences/a/00000007.jpg", "m/sequences/a/00000009.jpg",
          "m/sequences/mpii_human_pose_v1_sequences_batch3/c/00000001.jpg"}) {
      write(name, name);
    }
  }
  MpiiFrames open() const { return {folder_.path(), {"m/images"}, {"m/sequences", "m/absent"}}; }
  /// The frames so many steps after an image's keyframe.
  Texts steps(const std::string& image, const std::string& keyframe,
              std::initializer_list<int> steps) const {
    const MpiiFrames frames = open();
    Texts found;
    for (const int step : steps) {
      found.push_back(text_of(frames.paired_frame(frames.labelled(image, keyframe), step)));
    }
    return found;
  }
};

TEST_F(MpiiFramesTest, AKeyframeWithAFolderIsTheLabelledFrame) {
  const LabelledFrame labelled = open().labelled("a.jpg", "a/00000007.jpg");
  EXPECT_EQ(labelled.sample_id, "a");
  EXPECT_EQ(labelled.sequence, "a");
  EXPECT_TRUE(std::isnan(labelled.frame.time_s));
  EXPECT_THAT(
      steps("a.jpg", "a/00000007.jpg", {-3, -2, 0, 1, 2, 3}),
      ElementsAre("beyond", "present m/sequences/a/00000005.jpg 5",
                  "present m/sequences/a/00000007.jpg 7", "missing m/sequences/a/00000008.jpg 8",
                  "present m/sequences/a/00000009.jpg 9", "beyond"));
}

TEST_F(MpiiFramesTest, LostFramesAreMissingHoweverManyAreLost) {
  write("m/sequences/a/00000040.jpg");
  for (const int number : {5, 6, 9}) {
    fs::remove(at("m/sequences/a/0000000" + std::to_string(number) + ".jpg"));
  }
  EXPECT_THAT(steps("a.jpg", "a/00000007.jpg", {1}),
              ElementsAre("missing m/sequences/a/00000008.jpg 8"));
}

TEST_F(MpiiFramesTest, AnAbsentKeyframeOrImageIsAMissingFrame) {
  EXPECT_THAT(
      steps("a.jpg", "a/00000008.jpg", {-1, 0}),
      ElementsAre("present m/sequences/a/00000007.jpg 7", "missing m/sequences/a/00000008.jpg 8"));
  EXPECT_THAT(steps("z.jpg", "", {0}), ElementsAre("missing m/images/z.jpg -1"));
}

TEST_F(MpiiFramesTest, FindsSequencesInBatchFolders) {
  EXPECT_EQ(open().labelled("c.jpg", "c/00000001.jpg").frame.path,
            "m/sequences/mpii_human_pose_v1_sequences_batch3/c/00000001.jpg");
}

TEST_F(MpiiFramesTest, AnImageWithoutSequenceHasNoPairedFrames) {
  for (const std::string keyframe :
       {"b/00000020.jpg", "", "00000020.jpg", "/1.jpg", "a/x.jpg", "a/-1.jpg"}) {
    EXPECT_EQ(open().labelled("b.jpg", keyframe).sequence, "");
    const std::string number = keyframe == "b/00000020.jpg" ? "20" : "-1";
    EXPECT_THAT(steps("b.jpg", keyframe, {-1, 0, 1}),
                ElementsAre("beyond", "present m/images/b.jpg " + number, "beyond"));
  }
}

TEST_F(MpiiFramesTest, LooksForImagesInEachFolderInTurn) {
  touch({"m/root_only.jpg", "m/a.jpg"});
  const MpiiFrames frames(folder_.path(), {"m/images", "m"}, {});
  EXPECT_EQ(frames.labelled("root_only.jpg", "").frame.path, "m/root_only.jpg");
  EXPECT_EQ(frames.labelled("a.jpg", "").frame.path, "m/images/a.jpg");
}

TEST_F(MpiiFramesTest, FindsTheKeyframeByItsBytes) {
  EXPECT_EQ(open().find_keyframe("a.jpg"), "");
  write("m/images/a.jpg", "m/sequences/a/00000006.jpg");
  EXPECT_EQ(open().find_keyframe("a.jpg"), "a/00000006.jpg");
  for (const char* other : {"b.jpg", "z.jpg"}) EXPECT_EQ(open().find_keyframe(other), "");
}

TEST(WithoutExtension, CutsTheLastOneOnly) {
  EXPECT_EQ(without_extension("000000001.jpg"), "000000001");
  EXPECT_EQ(without_extension("a.b.jpg"), "a.b");
  EXPECT_EQ(without_extension("a"), "a");
  EXPECT_EQ(without_extension(".jpg"), ".jpg");
}

TEST(SortSamples, SortsAndRefusesTwoOfOneName) {
  std::vector<LabelledFrame> frames(3);
  for (const std::size_t i : {0, 1, 2}) frames[i].sample_id = "bca"[i];
  sort_samples(frames, "x.mat");
  EXPECT_THAT(ids_of(frames), ElementsAre("a", "b", "c"));
  frames[2].sample_id = "a";
  EXPECT_THROWS(sort_samples(frames, "x.mat"), InputError, "got a twice, in x.mat");
}

}  // namespace
}  // namespace eventgan
