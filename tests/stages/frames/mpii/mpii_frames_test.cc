#include "stages/frames/mpii/mpii_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class MpiiPlacesTest : public ::testing::Test {
 protected:
  MpiiPlacesTest() { spec_.root = "m"; }
  MpiiPlaces find() const { return find_mpii_places(spec_, folder_.path()); }

  testing::TemporaryFolder folder_;
  SourceSpec spec_;
};

TEST_F(MpiiPlacesTest, FindsTheFilesInTheRoot) {
  testing::write_file(folder_ / "m/mpii_human_pose_v1_u12_1.mat", "");
  testing::write_file(folder_ / "m/mpii_human_pose_v1_sequences_keyframes.mat", "");
  testing::write_file(folder_ / "m/mpii_human_pose_v1_sequences_batch2/x/1.jpg", "");
  testing::write_file(folder_ / "m/mpii_human_pose_v1_sequences_batch1/y/1.jpg", "");
  const MpiiPlaces places = find();
  EXPECT_EQ(places.annotations, "m/mpii_human_pose_v1_u12_1.mat");
  EXPECT_EQ(places.keyframes, "m/mpii_human_pose_v1_sequences_keyframes.mat");
  EXPECT_THAT(places.image_folders, ElementsAre("m/images"));
  EXPECT_THAT(places.sequence_folders,
              ElementsAre("m/sequences", "m/mpii_human_pose_v1_sequences_batch1",
                          "m/mpii_human_pose_v1_sequences_batch2"));
}

TEST_F(MpiiPlacesTest, FindsTheFilesInTheDownloadsFolder) {
  testing::write_file(folder_ / "m/mpii_human_pose_v1_u12_2/mpii_human_pose_v1_u12_1.mat", "");
  testing::write_file(folder_ / "m/mpii_human_pose_v1_sequences_keyframes.mat", "");
  EXPECT_EQ(find().annotations, "m/mpii_human_pose_v1_u12_2/mpii_human_pose_v1_u12_1.mat");
  EXPECT_EQ(find().keyframes, "m/mpii_human_pose_v1_sequences_keyframes.mat");
}

TEST_F(MpiiPlacesTest, TakesTheManifestsWord) {
  testing::write_file(folder_ / "m/x", "");
  testing::write_file(folder_ / "labels/mine.mat", "");
  testing::write_file(folder_ / "labels/mpii_human_pose_v1_sequences_keyframes.mat", "");
  testing::write_file(folder_ / "videos/x/1.jpg", "");
  spec_.annotations = "labels/mine.mat";
  spec_.sequences = "videos";
  EXPECT_EQ(find().annotations, "labels/mine.mat");
  EXPECT_EQ(find().keyframes, "labels/mpii_human_pose_v1_sequences_keyframes.mat");
  EXPECT_THAT(find().sequence_folders, ElementsAre("videos"));
}

TEST_F(MpiiPlacesTest, SaysWhatIsMissing) {
  EXPECT_THAT([&] { find(); }, ThrowsMessage<InputError>(HasSubstr(
                                   "expected a folder, got nothing that can be read, in m")));
  testing::write_file(folder_ / "m/x", "");
  EXPECT_THAT([&] { find(); }, ThrowsMessage<InputError>(AllOf(
                                   HasSubstr("expected mpii_human_pose_v1_u12_1.mat, got none"),
                                   HasSubstr("m or "), HasSubstr("mpii_human_pose_v1_u12_2"))));
  testing::write_file(folder_ / "m/mpii_human_pose_v1_u12_1.mat", "");
  EXPECT_EQ(find().keyframes, "") << "there are no sequences";
  testing::write_file(folder_ / "m/sequences/x/1.jpg", "");
  EXPECT_THAT(
      [&] { find(); },
      ThrowsMessage<InputError>(HasSubstr("expected mpii_human_pose_v1_sequences_keyframes.mat")));
  spec_.pairs.stills.emplace();
  EXPECT_EQ(find().keyframes, "") << "stills need none";
  spec_.pairs.stills.reset();
  testing::write_file(folder_ / "m/mpii_human_pose_v1_sequences_keyframes.mat", "");
  spec_.sequences = "videos";
  EXPECT_THAT([&] { find(); }, ThrowsMessage<InputError>(HasSubstr("videos")));
}

TEST(SameBytes, ComparesSizeAndContent) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "a", std::string_view("x\0y", 3));
  testing::write_file(folder / "same", std::string_view("x\0y", 3));
  testing::write_file(folder / "other", std::string_view("x\0z", 3));
  testing::write_file(folder / "longer", std::string_view("x\0yy", 4));
  testing::write_file(folder / "empty", "");
  EXPECT_TRUE(same_bytes(folder / "a", folder / "same"));
  EXPECT_TRUE(same_bytes(folder / "empty", folder / "empty"));
  EXPECT_FALSE(same_bytes(folder / "a", folder / "other"));
  EXPECT_FALSE(same_bytes(folder / "a", folder / "longer"));
  EXPECT_FALSE(same_bytes(folder / "a", folder / "absent"));
  EXPECT_FALSE(same_bytes(folder / "absent", folder / "absent"));
}

using State = PairedFrame::State;

/// Images a, b; sequence a with frames 5, 6, 7, 9 and keyframe 7; sequence c in a batch folder.
class MpiiFramesTest : public ::testing::Test {
 protected:
  MpiiFramesTest() {
    for (const char* name :
         {"m/images/a.jpg", "m/images/b.jpg", "m/sequences/a/00000005.jpg",
          "m/sequences/a/00000006.jpg", "m/sequences/a/00000007.jpg", "m/sequences/a/00000009.jpg",
          "m/sequences/mpii_human_pose_v1_sequences_batch3/c/00000001.jpg"}) {
      testing::write_file(folder_ / name, name);
    }
  }
  MpiiFrames open() const { return {folder_.path(), {"m/images"}, {"m/sequences", "m/absent"}}; }

  testing::TemporaryFolder folder_;
};

TEST_F(MpiiFramesTest, AKeyframeWithAFolderIsTheLabelledFrame) {
  const MpiiFrames frames = open();
  const LabelledFrame labelled = frames.labelled("a.jpg", "a/00000007.jpg");
  EXPECT_EQ(labelled.sample_id, "a");
  EXPECT_EQ(labelled.sequence, "a");
  EXPECT_EQ(labelled.frame, (FrameRef{"m/sequences/a/00000007.jpg", 7}));
  EXPECT_TRUE(std::isnan(labelled.frame.time_s));

  const PairedFrame itself = frames.paired_frame(labelled, 0);
  EXPECT_EQ(itself.state, State::kPresent);
  EXPECT_EQ(itself.frame, labelled.frame);
  const PairedFrame before = frames.paired_frame(labelled, -2);
  EXPECT_EQ(before.state, State::kPresent);
  EXPECT_EQ(before.frame, (FrameRef{"m/sequences/a/00000005.jpg", 5}));
  const PairedFrame missing = frames.paired_frame(labelled, 1);
  EXPECT_EQ(missing.state, State::kMissing);
  EXPECT_EQ(missing.frame.path, "m/sequences/a/00000008.jpg");
  EXPECT_EQ(frames.paired_frame(labelled, 2).state, State::kPresent);
  EXPECT_EQ(frames.paired_frame(labelled, 3).state, State::kBeyond);
  EXPECT_EQ(frames.paired_frame(labelled, -3).state, State::kBeyond);
}

TEST_F(MpiiFramesTest, LostFramesAreMissingHoweverManyAreLost) {
  testing::write_file(folder_ / "m/sequences/a/00000040.jpg", "");
  for (const char* name : {"00000005.jpg", "00000006.jpg", "00000009.jpg"}) {
    std::filesystem::remove(folder_ / "m/sequences/a" / name);
  }
  const MpiiFrames frames = open();
  const PairedFrame next = frames.paired_frame(frames.labelled("a.jpg", "a/00000007.jpg"), 1);
  EXPECT_EQ(next.state, State::kMissing);
  EXPECT_EQ(next.frame.path, "m/sequences/a/00000008.jpg");
}

TEST_F(MpiiFramesTest, AnAbsentKeyframeIsAMissingFrame) {
  const MpiiFrames frames = open();
  const LabelledFrame labelled = frames.labelled("a.jpg", "a/00000008.jpg");
  const PairedFrame itself = frames.paired_frame(labelled, 0);
  EXPECT_EQ(itself.state, State::kMissing);
  EXPECT_EQ(itself.frame, labelled.frame);
  EXPECT_EQ(frames.paired_frame(labelled, -1).state, State::kPresent);
}

TEST_F(MpiiFramesTest, FindsSequencesInBatchFolders) {
  const MpiiFrames frames = open();
  EXPECT_EQ(frames.labelled("c.jpg", "c/00000001.jpg").frame.path,
            "m/sequences/mpii_human_pose_v1_sequences_batch3/c/00000001.jpg");
}

TEST_F(MpiiFramesTest, AnImageWithoutSequenceHasNoPairedFrames) {
  const MpiiFrames frames = open();
  for (const char* keyframe :
       {"b/00000020.jpg", "", "00000020.jpg", "/1.jpg", "a/x.jpg", "a/-1.jpg"}) {
    const LabelledFrame labelled = frames.labelled("b.jpg", keyframe);
    EXPECT_EQ(labelled.sequence, "");
    EXPECT_EQ(labelled.frame.path, "m/images/b.jpg");
    EXPECT_EQ(labelled.frame.index, keyframe[0] == 'b' ? 20 : -1) << keyframe;
    EXPECT_EQ(frames.paired_frame(labelled, 0).state, State::kPresent);
    EXPECT_EQ(frames.paired_frame(labelled, 1).state, State::kBeyond);
    EXPECT_EQ(frames.paired_frame(labelled, -1).state, State::kBeyond);
  }
}

TEST_F(MpiiFramesTest, AnAbsentImageIsAMissingFrame) {
  const MpiiFrames frames = open();
  const PairedFrame itself = frames.paired_frame(frames.labelled("z.jpg", ""), 0);
  EXPECT_EQ(itself.state, State::kMissing);
  EXPECT_EQ(itself.frame.path, "m/images/z.jpg");
}

TEST_F(MpiiFramesTest, LooksForImagesInEachFolderInTurn) {
  testing::write_file(folder_ / "m/root_only.jpg", "x");
  testing::write_file(folder_ / "m/a.jpg", "x");
  const MpiiFrames frames(folder_.path(), {"m/images", "m"}, {});
  EXPECT_EQ(frames.labelled("root_only.jpg", "").frame.path, "m/root_only.jpg");
  EXPECT_EQ(frames.labelled("a.jpg", "").frame.path, "m/images/a.jpg");
}

TEST_F(MpiiFramesTest, FindsTheKeyframeByItsBytes) {
  EXPECT_EQ(open().find_keyframe("a.jpg"), "");
  testing::write_file(folder_ / "m/images/a.jpg", "m/sequences/a/00000006.jpg");
  EXPECT_EQ(open().find_keyframe("a.jpg"), "a/00000006.jpg");
  EXPECT_EQ(open().find_keyframe("b.jpg"), "");
  EXPECT_EQ(open().find_keyframe("z.jpg"), "");
}

TEST(WithoutExtension, CutsTheLastOneOnly) {
  EXPECT_EQ(without_extension("000000001.jpg"), "000000001");
  EXPECT_EQ(without_extension("a.b.jpg"), "a.b");
  EXPECT_EQ(without_extension("a"), "a");
  EXPECT_EQ(without_extension(".jpg"), ".jpg");
}

TEST(SortSamples, SortsAndRefusesTwoOfOneName) {
  std::vector<LabelledFrame> frames(3);
  frames[0].sample_id = "b";
  frames[1].sample_id = "c";
  frames[2].sample_id = "a";
  sort_samples(frames, "x.mat");
  EXPECT_EQ(frames[0].sample_id + frames[1].sample_id + frames[2].sample_id, "abc");
  frames[2].sample_id = "a";
  EXPECT_THAT([&] { sort_samples(frames, "x.mat"); },
              ThrowsMessage<InputError>(HasSubstr("got a twice, in x.mat")));
}

}  // namespace
}  // namespace eventgan
