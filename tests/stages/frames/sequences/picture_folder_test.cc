#include "stages/frames/sequences/picture_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using Frame = NumberedSequence::Frame;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

PictureFolder list(const std::vector<std::string>& names) {
  const testing::TemporaryFolder folder;
  for (const std::string& name : names) testing::write_file(folder / name, "");
  return list_picture_folder(folder.path());
}

TEST(PictureFolder, OnePrefixAndDigitsAreNumbers) {
  EXPECT_THAT(
      list({"img_10.png", "img_9.jpg", "img_0012.BMP", "notes.txt"}).frames.frames(),
      ElementsAre(Frame(9, "img_9.jpg"), Frame(10, "img_10.png"), Frame(12, "img_0012.BMP")));
  EXPECT_THAT(list({"000005.tif", "000000.tif"}).frames.frames(),
              ElementsAre(Frame(0, "000000.tif"), Frame(5, "000005.tif")));
}

TEST(PictureFolder, OtherNamesAreCountedInNaturalOrder) {
  EXPECT_THAT(list({"b.png", "a10.png", "a9.png"}).frames.frames(),
              ElementsAre(Frame(0, "a9.png"), Frame(1, "a10.png"), Frame(2, "b.png")));
  // Two prefixes; one number written in two ways; more digits than a number has.
  EXPECT_THAT(list({"a7.png", "b3.png"}).frames.frames(),
              ElementsAre(Frame(0, "a7.png"), Frame(1, "b3.png")));
  EXPECT_THAT(list({"7.png", "07.png"}).frames.frames(),
              ElementsAre(Frame(0, "07.png"), Frame(1, "7.png")));
  EXPECT_THAT(list({"1234567890123456789.png"}).frames.frames(),
              ElementsAre(Frame(0, "1234567890123456789.png")));
}

TEST(PictureFolder, OfTwoPicturesOfOneNameTheFirstExtensionCounts) {
  EXPECT_THAT(list({"a.jpg", "a.png", "a.bmp"}).frames.frames(), ElementsAre(Frame(0, "a.png")));
  EXPECT_THAT(list({"a.png", "a.PNG"}).frames.frames(), ElementsAre(Frame(0, "a.PNG")));
}

TEST(PictureFolder, FindsSidecarsAndFoldersAndPassesOverHiddenEntries) {
  const auto folder = list({"1.png", "1.json", "other.JSON", "two.json", "two.Json", ".2.png",
                            ".git/x", "z/1.png", "y/1.png"});
  EXPECT_THAT(folder.sidecars, ElementsAre(Pair("1", "1.json"), Pair("other", "other.JSON"),
                                           Pair("two", "two.Json")));
  EXPECT_THAT(folder.folders, ElementsAre("y", "z"));
  EXPECT_THAT(folder.frames.frames(), ElementsAre(Frame(1, "1.png")));
}

TEST(PictureFolder, TellsWhatItLeavesOut) {
  const auto folder = list({"1.jpg", "1.png", "1.json", "2.webp", "2.JSON", "2.json", "3.gif",
                            "notes.txt", ".hidden", "sub/1.png"});
  EXPECT_THAT(folder.frames.frames(), ElementsAre(Frame(1, "1.png"), Frame(2, "2.webp")));
  EXPECT_THAT(folder.left_out, ElementsAre("1.jpg", "2.json", "3.gif", "notes.txt"));
}

TEST(PictureFolder, MayBeEmpty) { EXPECT_THAT(list({}).frames.frames(), IsEmpty()); }

}  // namespace
}  // namespace eventgan
