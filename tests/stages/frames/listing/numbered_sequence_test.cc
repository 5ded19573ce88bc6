#include "stages/frames/listing/numbered_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/values/faults.h"
#include "stages/frames/listing/source_folders.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_file;

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
  EXPECT_EQ(counted({"a", "b"}, "file", " left out in clip"), "2 files left out in clip: a, b");
  const std::string many = counted(std::vector<std::string>(21, "a"), "file", "");
  EXPECT_TRUE(many.starts_with("21 files: a, a, "));
  EXPECT_TRUE(many.ends_with("a, ..."));
  EXPECT_EQ(std::ranges::count(many, 'a'), 20);
}

void expect_number(const std::string& stem, const NumberInName& expected) {
  const NumberInName found = find_number(stem);
  EXPECT_EQ(found.before, expected.before) << stem;
  EXPECT_EQ(found.digits, expected.digits) << stem;
  EXPECT_EQ(found.after, expected.after) << stem;
  EXPECT_EQ(found.number, expected.number) << stem;
  EXPECT_EQ(found.time_ns, expected.time_ns) << stem;
}

TEST(FindNumber, IsTheLastThatNoLetterFollows) {
  expect_number("000012", {"", "000012", "", 12});
  expect_number("aachen_000001_000019_leftImg8bit",
                {"aachen_000001_", "000019", "_leftImg8bit", 19});
  expect_number("a_mp4-9_jpg.rf.0f3c77", {"a_mp4-", "9", "_jpg", 9});
  expect_number("3l", {"", "3", "l", 3});
  expect_number("cover", {"cover", "", ""});
  expect_number("", {"", "", ""});
}

TEST(FindNumber, MayBeATime) {
  expect_number("cam1_1403636579763555584",
                {"cam1_", "1403636579763555584", "", 1403636579763555584, 1403636579763555584});
  expect_number("1305031102.175304",
                {"", "1305031102.175304", "", 1305031102175304000, 1305031102175304000});
  expect_number("1532402927612", {"", "1532402927612", "", 1532402927612, 1532402927612000000});
}

TEST(FindNumber, WhatDoesNotFitInto64BitsIsNoTimeAndNoNumber) {
  // An ISBN is 9.78e18 as milliseconds in nanoseconds, and 2^63 is 9.22e18.
  expect_number("9783161484100", {"", "9783161484100", "", 9783161484100});
  expect_number("9223372036854", {"", "9223372036854", "", 9223372036854, 9223372036854000000});
  expect_number("9999999999999999", {"", "9999999999999999", "", 9999999999999999});
  expect_number("9500000000.123456", {"9500000000.", "123456", "", 123456});
  expect_number("a9223372036854775808", {"a9223372036854775808", "", ""});
}

TEST(Renumbered, ReplacesTheNumberAlone) {
  EXPECT_EQ(renumbered("aachen_000001_000019_leftImg8bit.png", 20),
            "aachen_000001_000020_leftImg8bit.png");
  EXPECT_EQ(renumbered("a_mp4-9_jpg.rf.0f3c77.jpg", 10), "a_mp4-10_jpg.jpg");
  EXPECT_EQ(renumbered("7.png", 1234), "1234.png");
  EXPECT_EQ(renumbered("cover.png", 3), "cover3.png");
}

using State = PairedFrame::State;
using Stride = NumberedSequence::Stride;

NumberedSequence every_fifth() {
  return NumberedSequence({{16, "img_000016.jpg"}, {1, "img_000001.jpg"}, {6, "img_000006.jpg"}},
                          Stride::kInferred);
}

TEST(NumberedSequence, ListsFilesOfItsPatternByNumber) {
  const TemporaryFolder folder;
  for (const char* name : {"img_10.jpg", "img_2.JPG", "img_x.jpg", "img_.jpg", "other_3.jpg",
                           "img_4.txt", "img_5.jpg.part", "img_1234567890123456789.jpg"}) {
    write_file(folder / name, "");
  }
  write_file(folder / ".hidden.jpg", "");
  const NumberedSequence sequence = NumberedSequence::list(folder.path(), "img_");
  EXPECT_THAT(sequence.frames(), ElementsAre(Pair(2, "img_2.JPG"), Pair(10, "img_10.jpg")));
  EXPECT_THAT(sequence.left_out(),
              ElementsAre("img_.jpg", "img_1234567890123456789.jpg", "img_4.txt", "img_5.jpg.part",
                          "img_x.jpg", "other_3.jpg"));
}

TEST(NumberedSequence, PrefersTheFirstExtension) {
  const TemporaryFolder folder;
  for (const char* name : {"7.jpg", "7.png", "7.webp", "8.jpg", "9.webp"}) {
    write_file(folder / name, "");
  }
  const NumberedSequence sequence = NumberedSequence::list(folder.path());
  EXPECT_THAT(sequence.frames(),
              ElementsAre(Pair(7, "7.png"), Pair(8, "8.jpg"), Pair(9, "9.webp")));
  EXPECT_THAT(sequence.left_out(), ElementsAre("7.jpg", "7.webp"));
}

TEST(NumberedSequence, AFolderNamedAsAFrameIsThere) {
  const TemporaryFolder folder;
  write_file(folder / "7.png/inside", "");
  write_file(folder / "8.png", "");
  EXPECT_THAT(NumberedSequence::list(folder.path()).frames(),
              ElementsAre(Pair(7, "7.png"), Pair(8, "8.png")));
}

TEST(NumberedSequence, RefusesTwoFilesForOneNumber) {
  const TemporaryFolder folder;
  for (const char* name : {"7.png", "007.png"}) write_file(folder / name, "");
  try {
    NumberedSequence::list(folder.path());
    FAIL() << "listed two frames 7";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("got 007.png and 7.png"), HasSubstr(folder.path().string())));
  }
}

TEST(NumberedSequence, AnAbsentFolderIsEmptyAndAFileIsAnError) {
  const TemporaryFolder folder;
  const NumberedSequence absent = NumberedSequence::list(folder / "absent");
  EXPECT_TRUE(absent.empty());
  EXPECT_EQ(absent.stride(), 1);
  EXPECT_EQ(absent.at(3, 1).state, State::kBeyond);
  EXPECT_EQ(absent.at(3, -1).state, State::kBeyond);
  EXPECT_EQ(absent.at(3, 0).state, State::kMissing);

  write_file(folder / "file", "");
  EXPECT_THROW(NumberedSequence::list(folder / "file"), InputError);
}

TEST(NumberedSequence, AnInferredStrideIsTheSmallestDifference) {
  EXPECT_EQ(every_fifth().stride(), 5);  // 1, 6, 16: differences 5 and 10
  EXPECT_EQ(NumberedSequence({{4, "4.png"}}, Stride::kInferred).stride(), 1);
}

TEST(NumberedSequence, WhereEveryFrameIsStoredFarFramesAreNoPairedFrames) {
  const TemporaryFolder folder;
  for (const char* name : {"1.png", "40.png"}) write_file(folder / name, "");
  const NumberedSequence sequence = NumberedSequence::list(folder.path());
  EXPECT_EQ(sequence.stride(), 1);
  EXPECT_EQ(sequence.at(1, 1).state, State::kMissing);
  EXPECT_EQ(sequence.at(1, 1).name, "2.png");
  EXPECT_EQ(sequence.at(40, -1).state, State::kMissing);
  EXPECT_EQ(sequence.at(40, 1).state, State::kBeyond);

  const auto inferred =
      NumberedSequence::list(folder.path(), "", kImageExtensions, Stride::kInferred);
  EXPECT_EQ(inferred.at(1, 1).name, "40.png");
}

TEST(NumberedSequence, FindsFramesMissingOnesAndTheEnd) {
  const NumberedSequence sequence = every_fifth();
  const auto found = sequence.at(6, -1);
  EXPECT_EQ(found.state, State::kPresent);
  EXPECT_EQ(found.number, 1);
  EXPECT_EQ(found.name, "img_000001.jpg");

  const auto missing = sequence.at(6, 1);
  EXPECT_EQ(missing.state, State::kMissing);
  EXPECT_EQ(missing.number, 11);
  EXPECT_EQ(missing.name, "img_000011.jpg");

  EXPECT_EQ(sequence.at(6, 2).state, State::kPresent);
  EXPECT_EQ(sequence.at(6, 3).state, State::kBeyond);
  EXPECT_EQ(sequence.at(6, -2).state, State::kBeyond);
}

TEST(NumberedSequence, AMissingFrameHasPairedFrames) {
  const NumberedSequence sequence = every_fifth();
  EXPECT_EQ(sequence.at(11, 0).state, State::kMissing);
  EXPECT_EQ(sequence.at(11, 1).state, State::kPresent);
  EXPECT_EQ(sequence.at(21, 0).state,
            State::kMissing);  // even past the end: its label says it exists
  EXPECT_EQ(sequence.at(21, -1).number, 16);
}

TEST(NumberedSequence, FindsByNumberWhateverTheStride) {
  const NumberedSequence sequence = every_fifth();
  EXPECT_EQ(sequence.find(6).state, State::kPresent);
  EXPECT_EQ(sequence.find(7).state, State::kMissing);
  EXPECT_EQ(sequence.find(0).state, State::kBeyond);
  EXPECT_EQ(sequence.find(17).state, State::kBeyond);
  EXPECT_EQ(sequence.find(-5).state, State::kBeyond);
  EXPECT_EQ(NumberedSequence().find(0).state, State::kBeyond);
}

TEST(NumberedSequence, ContainsOnlyItsFrames) {
  EXPECT_TRUE(every_fifth().contains(16));
  EXPECT_FALSE(every_fifth().contains(11));
  EXPECT_FALSE(NumberedSequence().contains(0));
}

}  // namespace
}  // namespace eventgan
