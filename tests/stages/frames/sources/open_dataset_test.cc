#include "stages/frames/sources/open_dataset.h"

#include <sys/stat.h>

#include <exception>

#include "stages/frames/listing/source_folders.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

TEST(SourceRoot, WritesPathsAsTheManifestDoesAndOpensThemBelowItUnlessTheyAreAbsolute) {
  const std::array<const char*, 3> written[] = {{"kitti/training", "a/b", "kitti/training/a/b"},
                                                {"kitti/training//", "a", "kitti/training/a"},
                                                {"kitti", "", "kitti"},
                                                {"/", "a", "/a"},
                                                {"", "a", "a"}};
  for (const auto& [root, path, expected] : written) {
    EXPECT_EQ(SourceRoot(root, "/data").written(path), expected);
  }
  EXPECT_EQ(SourceRoot("kitti", "/data").on_disk("a/b"), "/data/kitti/a/b");
  EXPECT_EQ(SourceRoot("/kitti", "/data").on_disk("a"), "/kitti/a");
  EXPECT_EQ(SourceRoot("kitti", "/data").on_disk(""), "/data/kitti");
}

TEST(SourceRoot, ReadsWholeFilesByteForByte) {
  const TemporaryFolder folder;
  std::string bytes(100'000, 'x');  // more than one block
  bytes[50'000] = '\0';
  bytes += "\r\n";
  write_file(folder / "root/file", bytes);
  write_file(folder / "root/empty", "");
  const SourceRoot root("root", folder.path());
  EXPECT_EQ(*root.read("file"), bytes);
  EXPECT_EQ(root.read_or_throw("empty"), "");
}

TEST(SourceRoot, AFileThatCannotBeReadIsNamedWithTheReason) {
  const TemporaryFolder folder;
  write_file(folder / "root/sub/file", "");
  const SourceRoot root("root", folder.path());
  const char* none = "expected a readable file, got 'No such file or directory', in root/none";
  EXPECT_EQ(fault_of(root.read("none")), none);
  EXPECT_THROWS(root.read_or_throw("none"), InputError, none);
  EXPECT_THAT(fault_of(root.read("sub")), HasSubstr("Is a directory"));
}

TEST(SourceRoot, RequiresFolders) {
  const TemporaryFolder folder;
  write_file(folder / "root/sub/file", "");
  const SourceRoot root("root", folder.path());
  for (const char* path : {"", "sub"}) root.require_folder(path);
  for (const char* path : {"none", "sub/file"}) {
    EXPECT_THROWS(root.require_folder(path), InputError, "expected a folder", path);
  }
}

TEST(SourceRoot, ListsNamesInOrder) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "S9/x", "S11/x"}) write_file(folder / name, "");
  const SourceRoot root(".", folder.path());
  EXPECT_THAT(root.folders_in(""), ElementsAre("S11", "S9"));
  EXPECT_THAT(root.files_in(""), ElementsAre("a"));
  EXPECT_TRUE(root.has_file("a"));
  EXPECT_FALSE(root.has_file("none"));
  EXPECT_FALSE(root.has_file(""));
}

/// A label that is there and cannot be read must not pass for one that is not there.
TEST(SourceRoot, WhatCannotBeReadIsThereAllTheSame) {
  const TemporaryFolder folder;
  write_file(folder / "root/file", "");
  ASSERT_EQ(::mkfifo((folder / "root/fifo").c_str(), 0600), 0);
  fs::create_symlink("loop", folder / "root/loop");
  fs::create_symlink("nowhere", folder / "root/dangling");
  const SourceRoot root("root", folder.path());
  for (const auto& [name, reason] : {std::pair("fifo", "Not a regular file"),
                                     std::pair("loop", "Too many levels of symbolic links"),
                                     std::pair("dangling", "No such file or directory")}) {
    EXPECT_TRUE(root.has_file(name)) << name;
    EXPECT_EQ(fault_of(root.read(name)),
              "expected a readable file, got '" + std::string(reason) + "', in root/" + name);
  }
}

// What each kind of dataset misses first in an empty folder tells which one was opened.
TEST(OpenDataset, OpensTheKindTheManifestNames) {
  const TemporaryFolder folder;
  const std::pair<DatasetKind, const char*> missing[] = {
      {DatasetKind::kKittiObject, "./image_2"},
      {DatasetKind::kKittiTracking, "./label_02"},
      {DatasetKind::kKittiRaw, "DATE/DATE_drive_NNNN_sync"},
      {DatasetKind::kMpii, "mpii_human_pose_v1_u12_1.mat"},
      {DatasetKind::kMpiiList, "the key annotations"},
      {DatasetKind::kHuman36m, "layout"},
      {DatasetKind::kFrames, "folders of images"},
  };
  for (const auto& [kind, what] : missing) {
    SourceSpec spec;
    spec.dataset = kind;
    spec.root = ".";
    EXPECT_THROWS(open_dataset(spec, folder.path()), std::exception, what) << to_string(kind);
  }
}

// What is behind a NUL is lost in a shard and to the file system: two names could be one.
TEST(OpenDataset, RefusesNamesWithNul) {
  const TemporaryFolder folder;
  SourceSpec spec;
  spec.dataset = DatasetKind::kMpiiList;
  spec.root = "mpii";
  spec.annotations = "mpii/list.json";
  write_file(folder / "mpii/images/a.jpg", "");
  write_file(folder / "mpii/list.json", R"([{"image": "a.jpg\u0000x"}])");
  EXPECT_THROWS(open_dataset(spec, folder.path()), InputError,
                StrEq("expected names of frames without NUL, got \"mpii/images/a.jpg\\u0000x\", in "
                      "mpii/list.json:a.jpg\\u0000x"));
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
