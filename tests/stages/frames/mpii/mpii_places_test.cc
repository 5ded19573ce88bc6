#include "stages/frames/mpii/mpii_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
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
  EXPECT_THAT(
      [&] { find(); },
      ThrowsMessage<InputError>(HasSubstr("expected mpii_human_pose_v1_sequences_keyframes.mat")));
  testing::write_file(folder_ / "m/mpii_human_pose_v1_sequences_keyframes.mat", "");
  spec_.sequences = "videos";
  EXPECT_THAT([&] { find(); }, ThrowsMessage<InputError>(HasSubstr("videos")));
}

}  // namespace
}  // namespace eventgan
