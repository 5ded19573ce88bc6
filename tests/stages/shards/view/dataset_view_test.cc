#include "stages/shards/dataset_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "manifests/files/sha256.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/stages/shards/view/example_view.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

// What a view holds is looked at with stock h5py, in view_h5py_test.py.

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::names_in;
using testing::read_file;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;

ViewShard shard(const std::string& split, const std::string& name, std::vector<std::int32_t> boxes,
                std::vector<std::int32_t> persons) {
  ViewShard result{split, {}};
  result.record.shard = name;
  result.record.samples = static_cast<int>(boxes.size());
  result.record.valid = result.record.samples;
  result.record.contents.boxes = std::move(boxes);
  result.record.contents.persons = std::move(persons);
  return result;
}

TEST(ViewLayout, OfNoShardsAndOfRowsBeyond32Bits) {
  ViewLayout layout = lay_out_view({});
  EXPECT_THAT(layout.shards, IsEmpty());
  EXPECT_THAT(layout.splits, IsEmpty());
  EXPECT_THAT(layout.box_offsets, ElementsAre(0));
  EXPECT_EQ(layout.sample_count(), 0);
  const std::int32_t most = 2147483647;
  layout = lay_out_view({shard("a", "0", {most, most, most}, {0, 0, 0})});
  EXPECT_EQ(layout.box_offsets.back(), 3LL * most);
  ViewShard second = shard("a", "1", {0, 0, 0}, {0, 0, 0});
  second.record.quarantined = {{0, "x", ""}, {2, "y", ""}};
  EXPECT_THAT(lay_out_view({shard("a", "0", {0}, {0}), second}).valid, ElementsAre(1, 0, 1, 0));
}

TEST(ViewLayout, SplitsAreWholeRangesInTheOrderOfTheirFirstShard) {
  const ViewLayout layout =
      lay_out_view({shard("val", "v0", {0, 2}, {1, 0}), shard("train", "t0", {3}, {0}),
                    shard("val", "v1", {1, 0, 0}, {0, 0, 4})});
  EXPECT_THAT(layout.splits, ElementsAre(SplitRange{"val", {0, 5}}, SplitRange{"train", {5, 1}}));
  ASSERT_EQ(layout.shards.size(), 3u);
  EXPECT_EQ(layout.shards[0].shard.record.shard, "v0");
  EXPECT_EQ(layout.shards[1].shard.record.shard, "v1");
  EXPECT_EQ(layout.shards[2].shard.record.shard, "t0");
  EXPECT_EQ(layout.shards[1].samples, (RowRange{2, 3}));
  EXPECT_EQ(layout.shards[2].samples, (RowRange{5, 1}));
}

TEST(ViewLayout, OffsetsRunThroughAllShards) {
  const ViewLayout layout =
      lay_out_view({shard("a", "0", {0, 2}, {1, 0}), shard("b", "1", {3}, {0}),
                    shard("a", "2", {1, 0}, {0, 4})});
  // Samples in the order of the view: 0.0, 0.1, 2.0, 2.1, 1.0.
  EXPECT_THAT(layout.box_offsets, ElementsAre(0, 0, 2, 3, 3, 6));
  EXPECT_THAT(layout.person_offsets, ElementsAre(0, 1, 1, 1, 5, 5));
  EXPECT_EQ(layout.shards[1].boxes, (RowRange{2, 1}));
  EXPECT_EQ(layout.shards[1].persons, (RowRange{1, 4}));
  EXPECT_EQ(layout.shards[2].boxes, (RowRange{3, 3}));
  EXPECT_EQ(layout.shards[2].persons, (RowRange{5, 0}));
}

TEST(ViewLayout, CommitRecordsThatContradictThemselvesAreRefused) {
  const auto message_of = [](const ViewShard& bad) {
    return [bad] { lay_out_view({shard("a", "good", {1}, {1}), bad}); };
  };
  EXPECT_THAT(
      message_of(shard("a", "bad", {1, 1}, {1})),
      ThrowsMessage<std::runtime_error>(HasSubstr(
          "expected numbers of persons for 2 samples, got 1, in the commit record of bad")));
  EXPECT_THAT(message_of(shard("a", "bad", {-1}, {0})),
              ThrowsMessage<std::runtime_error>(HasSubstr("0 or more boxes of a sample, got -1")));
  ViewShard slot = shard("a", "bad", {1}, {0});
  slot.record.quarantined = {{1, "x", ""}};
  EXPECT_THAT(message_of(slot),
              ThrowsMessage<std::runtime_error>(HasSubstr("expected a slot below 1, got 1")));
  ViewShard huge = shard("a", "bad", {}, {});
  huge.record.samples = 3;
  EXPECT_THAT(message_of(huge), ThrowsMessage<std::runtime_error>(HasSubstr("3 samples, got 0")));
}

/// `shards` shards of two samples with three boxes and no persons, none of which exists.
DatasetView view_of_nothing(int shards) {
  DatasetView view{"", testing::example_shard().header, {}};
  std::vector<ViewShard> list;
  for (int i = 0; i < shards; ++i) {
    ViewShard shard{i % 2 == 0 ? "train" : "val", {}};
    shard.record.shard = "demo-" + std::to_string(i) + ".h5";
    shard.record.samples = 2;
    shard.record.contents.boxes = {1, 2};
    shard.record.contents.persons = {0, 0};
    list.push_back(shard);
  }
  view.layout = lay_out_view(std::move(list));
  return view;
}

TEST(DatasetViewFile, IsPublishedWhole) {
  const TemporaryFolder folder;
  const ViewReceipt receipt = write_dataset_view(folder / "dataset.h5", {view_of_nothing(3)});
  EXPECT_THAT(names_in(folder.path()), ElementsAre("dataset.h5"));
  const std::string bytes = read_file(folder / "dataset.h5");
  EXPECT_EQ(receipt.size_bytes, std::ssize(bytes));
  EXPECT_EQ(receipt.sha256, sha256_hex(bytes));
}

TEST(DatasetViewFile, TheSameViewGivesTheSameBytesWhereverItIs) {
  const TemporaryFolder here;
  const TemporaryFolder there;
  const auto write = [](const TemporaryFolder& folder) {
    return write_dataset_view(folder / "dataset.h5", {testing::write_example_view_shards(
                                                         folder.path(), StoredType::kUint8)})
        .sha256;
  };
  const std::string first = write(here);
  EXPECT_EQ(write(there), first);
  EXPECT_EQ(write(here), first);  // again, over the old one
}

TEST(DatasetViewFile, AFullDiskLeavesTheOldView) {
  const TemporaryFolder folder;
  write_dataset_view(folder / "dataset.h5", {view_of_nothing(1)});
  const std::string before = read_file(folder / "dataset.h5");
  const std::string error = testing::error_on_full_disk(
      before.size() / 2, [&] { write_dataset_view(folder / "dataset.h5", {view_of_nothing(50)}); });
  EXPECT_THAT(error, HasSubstr("cannot write " + folder.path().string()));
  EXPECT_THAT(names_in(folder.path()), ElementsAre("dataset.h5"));
  EXPECT_EQ(read_file(folder / "dataset.h5"), before);
}

TEST(DatasetViewFile, AFolderThatIsNotThereIsNamedAndNoViewsAreACallersMistake) {
  const TemporaryFolder folder;
  EXPECT_THROWS(write_dataset_view(folder / "no/dataset.h5", {view_of_nothing(1)}),
                std::runtime_error, "/no/.dataset.h5");
  EXPECT_THROWS(write_dataset_view(folder / "dataset.h5", {}), std::invalid_argument,
                "expected at least one view, got none");
}

}  // namespace
}  // namespace eventgan
