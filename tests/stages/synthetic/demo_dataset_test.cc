#include "stages/synthetic/demo_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "stages/frames/sources/frame_selection.h"
#include "stages/synthetic/layouts/layout_writers.h"
#include "stages/synthetic/layouts/output_files.h"
#include "stages/synthetic/scenes/road_scene.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::read_file;
using testing::TemporaryFolder;
using testing::write_file;

/// Every file below a folder by its path from there.
std::map<std::string, std::string> content_of(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    files[entry.path().lexically_relative(folder).generic_string()] = read_file(entry.path());
  }
  return files;
}

using Files = std::map<std::string, std::string>;

std::ptrdiff_t count_below(const Files& files, const std::string& folder) {
  return std::count_if(files.begin(), files.end(),
                       [&](const auto& file) { return file.first.starts_with(folder + "/"); });
}

void expect_three_layouts(const Files& files) {
  EXPECT_EQ(count_below(files, "kitti/training/image_2"), 12);
  EXPECT_EQ(count_below(files, "kitti/training/prev_2"), 36);
  EXPECT_EQ(count_below(files, "kitti/training/label_2"), 12);
  EXPECT_EQ(count_below(files, "kitti/training/calib"), 12);
  EXPECT_EQ(count_below(files, "mpii/images"), 7);
  EXPECT_EQ(count_below(files, "mpii/sequences/000000001"), 13);
  EXPECT_EQ(count_below(files, "h36m/S1/Walking-1/imageSequence/54138969"), 12);
  EXPECT_EQ(count_below(files, "h36m/S1/Walking-1/imageSequence/55011271"), 12);
  for (const char* file :
       {"manifest.json", "mpii/mpii_human_pose_v1_u12_1.mat", "h36m/S1/Walking-1/annot.h5",
        "mpii/mpii_human_pose_v1_sequences_keyframes.mat", "kitti/training/prev_2/000011_03.png",
        "h36m/S1/Walking-1/imageSequence/54138969/img_000056.jpg"}) {
    EXPECT_TRUE(files.contains(file)) << file;
  }
}

void expect_frames_where_they_belong(const Files& files) {
  // Labelled image i is frame 3 + 2 i of the drive: image 4 is frame 11, which is image 5's
  // second previous frame.
  EXPECT_EQ(files.at("kitti/training/label_2/000004.txt"), kitti_labels(RoadScene(7).labels(11)));
  EXPECT_EQ(files.at("kitti/training/image_2/000004.png"),
            files.at("kitti/training/prev_2/000005_02.png"));
  EXPECT_NE(files.at("kitti/training/image_2/000005.png"),
            files.at("kitti/training/prev_2/000005_01.png"));
  EXPECT_EQ(files.at("mpii/images/000000003.jpg"),
            files.at("mpii/sequences/000000003/00000007.jpg"));
}

// One test, since the dataset takes a second to make.
TEST(DemoDataset, IsCompleteSmallAndTheSameForTheSameSeed) {
  const TemporaryFolder folder;
  write_demo_dataset(folder / "new", 7);
  const Files files = content_of(folder / "new");
  expect_three_layouts(files);
  expect_frames_where_they_belong(files);
  std::size_t bytes = 0;
  for (const auto& [name, content] : files) bytes += content.size();
  EXPECT_LT(bytes, std::size_t{10} << 20);

  std::filesystem::create_directory(folder / "empty");
  write_demo_dataset(folder / "empty", 7);
  EXPECT_TRUE(content_of(folder / "empty") == files);
}

TEST(DemoDataset, ScenesAreStreetsOfTheirOwn) {
  const TemporaryFolder folder;
  write_demo_dataset(folder / "two", 7, 2, 3);
  const Files files = content_of(folder / "two");
  EXPECT_EQ(files.at("kitti/training/label_2/000001.txt"), kitti_labels(RoadScene(8).labels(4)));
  EXPECT_EQ(files.count("kitti/training/image_2/000002.png"), 0u);
  EXPECT_EQ(files.count("kitti/training/prev_2/000001_03.png"), 1u);
  EXPECT_EQ(files.count("mpii/images/000000007.jpg"), 1u);

  // Between the frame before and the labelled one; around the labelled figure.
  const std::string street = "kitti/training/between_2/000001/0000";
  EXPECT_EQ(files.at(street + "0.png"), files.at("kitti/training/prev_2/000001_01.png"));
  EXPECT_EQ(files.at(street + "4.png"), files.at("kitti/training/image_2/000001.png"));
  EXPECT_EQ(files.count(street + "5.png"), 0u);
  write_png(RoadScene(8).render(3.5), folder / "half.png");
  EXPECT_EQ(files.at(street + "2.png"), read_file(folder / "half.png"));
  EXPECT_NE(files.at(street + "2.png"), files.at(street + "1.png"));
  EXPECT_EQ(files.count("mpii/between/000000001/00008.png"), 1u);
  EXPECT_EQ(files.count("mpii/between/000000001/00009.png"), 0u);
}

TEST(DemoDataset, RefusesAFolderWithContentAndAFile) {
  const TemporaryFolder folder;
  write_file(folder / "full/notes.txt", "mine");
  EXPECT_THROWS(write_demo_dataset(folder / "full", 7), UsageError,
                "expected a new or empty folder, got one with files in it");
  EXPECT_THROWS(write_demo_dataset(folder / "full/notes.txt", 7), UsageError,
                "expected a new or empty folder, got a file, at");
  EXPECT_EQ(content_of(folder.path()).size(), 1u) << "nothing was written";
}

TEST(DemoDataset, LeavesNothingOnAFullDisk) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "empty");
  for (const char* name : {"new", "empty"}) {
    // Enough for some images.
    EXPECT_THAT(
        testing::error_on_full_disk(20000, [&] { write_demo_dataset(folder / name, 7, 1, 1); }),
        ::testing::HasSubstr((folder / name).string() + "/"));
  }
  EXPECT_THAT(testing::names_in(folder.path()), ::testing::ElementsAre("empty"));
  EXPECT_THAT(testing::names_in(folder / "empty"), ::testing::IsEmpty());
}

TEST(DemoDataset, CountsItsImages) {
  const TemporaryFolder folder;
  int images = 0;
  write_demo_dataset(folder / "one", 7, 1, 0, [&] { ++images; });
  EXPECT_EQ(images, 1 + 7);
  EXPECT_EQ(demo_image_count(1), images);
  EXPECT_EQ(demo_image_count(0), 12 + 7);
  EXPECT_EQ(demo_image_count(10), 10 + 10);
}

TEST(DemoManifest, HasBothPartsOfAnyNumberOfScenes) {
  for (int sequences = 1; sequences < 40; ++sequences) {
    for (const std::uint64_t seed : {1, 7, 12345}) {
      const JobManifest manifest =
          parse_job_manifest(demo_manifest(seed, sequences), "/demo", "manifest.json");
      ASSERT_EQ(manifest.sources.size(), sequences == 1 ? 4u : 5u);
      for (const SourceSpec& source : manifest.sources) {
        if (source.dataset == DatasetKind::kHuman36m) continue;
        const bool is_kitti = source.dataset == DatasetKind::kKittiObject;
        std::vector<LabelledFrame> frames;
        for (const std::string& name :
             is_kitti ? kitti_layout_names(sequences) : mpii_layout_names(sequences)) {
          frames.push_back({name, is_kitti ? "" : name, {}, name});
        }
        EXPECT_NO_THROW(select_frames(frames, source, "/demo", manifest.seed))
            << sequences << " scenes, " << seed << ", " << to_string(source.dataset) << ", "
            << source.split;
      }
    }
  }
}

TEST(DemoManifest, IsAManifestOfTheThreeLayouts) {
  const JobManifest manifest = parse_job_manifest(demo_manifest(12345), "/demo", "manifest.json");
  EXPECT_EQ(manifest.seed, 12345u);
  ASSERT_EQ(manifest.sources.size(), 3u);
  EXPECT_EQ(manifest.sources[0].dataset, DatasetKind::kKittiObject);
  EXPECT_EQ(manifest.sources[0].root, "kitti/training");
  EXPECT_EQ(manifest.sources[1].dataset, DatasetKind::kMpii);
  EXPECT_EQ(manifest.sources[1].root, "mpii");
  EXPECT_EQ(manifest.sources[2].dataset, DatasetKind::kHuman36m);
  EXPECT_EQ(manifest.sources[2].root, "h36m");

  const JobManifest split = parse_job_manifest(demo_manifest(7, 400), "/demo", "manifest.json");
  ASSERT_EQ(split.sources.size(), 5u);
  EXPECT_EQ(split.sources[1].split, "val");
  EXPECT_EQ(split.sources[0].selection.fraction[1], 0.8);
  EXPECT_EQ(split.sources[1].selection.fraction[0], 0.8);
}

}  // namespace
}  // namespace eventgan
