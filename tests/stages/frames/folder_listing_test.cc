#include "stages/frames/folder_listing.h"

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
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

TEST(FolderListing, TellsFoldersFromOtherFilesSorted) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"b", "a", "C", "S9/x", "S11/x"}) testing::write_file(folder / name, "");
  std::filesystem::create_symlink("nowhere", folder / "dangling");
  std::filesystem::create_symlink("S9", folder / "to_folder");
  const FolderListing listing = list_folder(folder.path());
  EXPECT_THAT(listing.files, ElementsAre("C", "a", "b", "dangling"));
  EXPECT_THAT(listing.folders, ElementsAre("S11", "S9", "to_folder"));
}

TEST(FolderListing, AnAbsentFolderHoldsNothingButAFileIsNone) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT(list_folder(folder / "absent").files, IsEmpty());
  testing::write_file(folder / "file", "");
  EXPECT_THAT([&] { list_folder(folder / "file"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("expected a readable folder"),
                                              HasSubstr((folder / "file").string()))));
}

TEST(Counted, NamesTwentyAtMost) {
  EXPECT_EQ(counted({"a", "b"}, "files left out in clip"), "2 files left out in clip: a, b");
  const std::string many = counted(std::vector<std::string>(21, "a"), "files");
  EXPECT_TRUE(many.starts_with("21 files: a, a, "));
  EXPECT_TRUE(many.ends_with("a, ..."));
  EXPECT_EQ(std::ranges::count(many, 'a'), 20);
}

}  // namespace
}  // namespace eventgan
