#include "stages/frames/open_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <exception>

#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;

// What each kind of dataset misses first in an empty folder tells which one was opened.
TEST(OpenDataset, OpensTheKindTheManifestNames) {
  const testing::TemporaryFolder folder;
  const std::pair<DatasetKind, const char*> missing[] = {
      {DatasetKind::kKittiObject, "./image_2"},
      {DatasetKind::kKittiTracking, "./label_02"},
      {DatasetKind::kKittiRaw, "DATE/DATE_drive_NNNN_sync"},
      {DatasetKind::kMpii, "mpii_human_pose_v1_u12_1.mat"},
      {DatasetKind::kMpiiList, "the key annotations"},
      {DatasetKind::kHuman36m, "layout"},
      {DatasetKind::kFrames, "folders of pictures"},
  };
  for (const auto& [kind, what] : missing) {
    SourceSpec spec;
    spec.dataset = kind;
    spec.root = ".";
    try {
      open_dataset(spec, folder.path());
      ADD_FAILURE() << "opened an empty folder as " << to_string(kind);
    } catch (const std::exception& error) {
      EXPECT_THAT(error.what(), HasSubstr(what)) << to_string(kind);
    }
  }
}

TEST(OpenDataset, OpensRealDataOfEveryKind) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto labelled = [&](DatasetKind kind, const char* root, const char* annotations = nullptr) {
    SourceSpec spec;
    spec.dataset = kind;
    spec.root = root;
    if (annotations) spec.annotations = annotations;
    if (kind == DatasetKind::kHuman36m) spec.layout = Human36mLayout::kFetch;
    return open_dataset(spec, data)->labelled_frames().size();
  };
  EXPECT_EQ(labelled(DatasetKind::kKittiObject, "kitti_object/training"), 4u);
  EXPECT_EQ(labelled(DatasetKind::kKittiRaw, "kitti_raw"), 21u);
  EXPECT_GT(labelled(DatasetKind::kMpii, "mpii"), 0u);
  EXPECT_GT(labelled(DatasetKind::kMpiiList, "mpii_lists", "mpii_lists/test_mpii.json"), 0u);
  EXPECT_GT(labelled(DatasetKind::kHuman36m, "human36m_fetch"), 0u);
  EXPECT_EQ(labelled(DatasetKind::kFrames, "davis/slider_depth/images"), 3u);
}

}  // namespace
}  // namespace eventgan
