#include "stages/shards/view/dataset_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/files/sha256.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/stages/shards/view/example_view.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

// What a view holds is looked at with stock h5py, in view_h5py_test.py.

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::names_in;
using testing::read_file;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;

/// `shards` shards of two samples with three boxes and no persons, none of which exists.
DatasetView view_of_nothing(int shards) {
  DatasetView view{"", testing::example_shard().header, {}};
  std::vector<ViewShard> list;
  for (int i = 0; i < shards; ++i) {
    ViewShard shard{i % 2 == 0 ? "train" : "val", {}};
    shard.marker.shard = "demo-" + std::to_string(i) + ".h5";
    shard.marker.samples = 2;
    shard.marker.boxes = {1, 2};
    shard.marker.persons = {0, 0};
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

TEST(DatasetViewFile, AFolderThatIsNotThereIsNamed) {
  const TemporaryFolder folder;
  EXPECT_THAT([&] { write_dataset_view(folder / "no/dataset.h5", {view_of_nothing(1)}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("/no/.dataset.h5")));
}

TEST(DatasetViewFile, NoViewsAreACallersMistake) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_dataset_view(folder / "dataset.h5", {}), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
