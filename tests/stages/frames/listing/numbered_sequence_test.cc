#include "stages/frames/listing/numbered_sequence.h"

#include "stages/frames/listing/source_folders.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

TEST(FolderListing, TellsFoldersFromOtherFilesSorted) {
  const TemporaryFolder folder;
  for (const char* name : {"b", "a", "C", "S9/x", "S11/x"}) write_file(folder / name, "");
  fs::create_symlink("nowhere", folder / "dangling");
  fs::create_symlink("S9", folder / "to_folder");
  const FolderListing listing = list_folder(folder.path());
  EXPECT_THAT(listing.files, ElementsAre("C", "a", "b", "dangling"));
  EXPECT_THAT(listing.folders, ElementsAre("S11", "S9", "to_folder"));
}

TEST(FolderListing, AnAbsentFolderHoldsNothingButAFileIsNone) {
  const TemporaryFolder folder;
  EXPECT_THAT(list_folder(folder / "absent").files, IsEmpty());
  write_file(folder / "file", "");
  EXPECT_THROWS(list_folder(folder / "file"), InputError, "expected a readable folder",
                (folder / "file").string());
}

TEST(Counted, NamesTwentyAtMost) {
  EXPECT_EQ(counted({"a", "b"}, "file", " left out in clip"), "2 files left out in clip: a, b");
  const std::string many = counted(std::vector<std::string>(21, "a"), "file", "");
  EXPECT_TRUE(many.starts_with("21 files: a, a, "));
  EXPECT_TRUE(many.ends_with("a, ..."));
  EXPECT_EQ(std::ranges::count(many, 'a'), 20);
}

TEST(FindNumber, IsTheLastThatNoLetterFollows) {
  const std::pair<std::string, NumberInName> cases[] = {
      {"000012", {"", "000012", "", 12}},
      {"aachen_000001_000019_leftImg8bit", {"aachen_000001_", "000019", "_leftImg8bit", 19}},
      {"a_mp4-9_jpg.rf.0f3c77", {"a_mp4-", "9", "_jpg", 9}},
      {"3l", {"", "3", "l", 3}},
      {"cover", {"cover", "", ""}},
      {"", {"", "", ""}},
      // It may be a time.
      {"cam1_1403636579763555584",
       {"cam1_", "1403636579763555584", "", 1403636579763555584, 1403636579763555584}},
      {"1305031102.175304",
       {"", "1305031102.175304", "", 1305031102175304000, 1305031102175304000}},
      {"1532402927612", {"", "1532402927612", "", 1532402927612, 1532402927612000000}},
      // What does not fit into 64 bits is no time and no number: an ISBN is 9.78e18 as milliseconds
      // in nanoseconds, and 2^63 is 9.22e18.
      {"9783161484100", {"", "9783161484100", "", 9783161484100}},
      {"9223372036854", {"", "9223372036854", "", 9223372036854, 9223372036854000000}},
      {"9999999999999999", {"", "9999999999999999", "", 9999999999999999}},
      {"9500000000.123456", {"9500000000.", "123456", "", 123456}},
      {"a9223372036854775808", {"a9223372036854775808", "", ""}}};
  for (const auto& [stem, expected] : cases) {
    SCOPED_TRACE(stem);
    const NumberInName found = find_number(stem);
    EXPECT_EQ(found.before, expected.before);
    EXPECT_EQ(found.digits, expected.digits);
    EXPECT_EQ(found.after, expected.after);
    EXPECT_EQ(found.number, expected.number);
    EXPECT_EQ(found.time_ns, expected.time_ns);
  }
}

TEST(Renumbered, ReplacesTheNumberAlone) {
  EXPECT_EQ(renumbered("aachen_000001_000019_leftImg8bit.png", 20),
            "aachen_000001_000020_leftImg8bit.png");
  EXPECT_EQ(renumbered("a_mp4-9_jpg.rf.0f3c77.jpg", 10), "a_mp4-10_jpg.jpg");
  EXPECT_EQ(renumbered("7.png", 1234), "1234.png");
  EXPECT_EQ(renumbered("cover.png", 3), "cover3.png");
}

using Stride = NumberedSequence::Stride;

/// "present NUMBER NAME", "missing NUMBER NAME" or "beyond".
template <class Place>
std::string place(const Place& found) {
  if (found.state == State::kBeyond) return "beyond";
  return (found.state == State::kPresent ? "present " : "missing ") + std::to_string(found.number) +
         " " + found.name;
}

NumberedSequence list_of(const Texts& names, const std::string& prefix = "") {
  const TemporaryFolder folder;
  for (const std::string& name : names) write_file(folder / name, "");
  return NumberedSequence::list(folder.path(), prefix);
}

NumberedSequence every_fifth() {
  return NumberedSequence({{16, "img_000016.jpg"}, {1, "img_000001.jpg"}, {6, "img_000006.jpg"}},
                          Stride::kInferred);
}

TEST(NumberedSequence, ListsFilesOfItsPatternByNumber) {
  const NumberedSequence sequence =
      list_of({"img_10.jpg", "img_2.JPG", "img_x.jpg", "img_.jpg", "other_3.jpg", "img_4.txt",
               "img_5.jpg.part", "img_1234567890123456789.jpg", ".hidden.jpg"},
              "img_");
  EXPECT_THAT(sequence.frames(), ElementsAre(Pair(2, "img_2.JPG"), Pair(10, "img_10.jpg")));
  EXPECT_THAT(sequence.left_out(),
              ElementsAre("img_.jpg", "img_1234567890123456789.jpg", "img_4.txt", "img_5.jpg.part",
                          "img_x.jpg", "other_3.jpg"));
}

TEST(NumberedSequence, PrefersTheFirstExtension) {
  const NumberedSequence sequence = list_of({"7.jpg", "7.png", "7.webp", "8.jpg", "9.webp"});
  EXPECT_THAT(sequence.frames(),
              ElementsAre(Pair(7, "7.png"), Pair(8, "8.jpg"), Pair(9, "9.webp")));
  EXPECT_THAT(sequence.left_out(), ElementsAre("7.jpg", "7.webp"));
}

TEST(NumberedSequence, AFolderNamedAsAFrameIsThere) {
  EXPECT_THAT(list_of({"7.png/inside", "8.png"}).frames(),
              ElementsAre(Pair(7, "7.png"), Pair(8, "8.png")));
}

TEST(NumberedSequence, RefusesTwoFilesForOneNumber) {
  const TemporaryFolder folder;
  for (const char* name : {"7.png", "007.png"}) write_file(folder / name, "");
  EXPECT_THROWS(NumberedSequence::list(folder.path()), InputError, "got 007.png and 7.png",
                folder.path().string());
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
  EXPECT_THROWS(NumberedSequence::list(folder / "file"), InputError, "expected a readable folder",
                (folder / "file").string());
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
  EXPECT_EQ(place(sequence.at(1, 1)), "missing 2 2.png");
  EXPECT_EQ(sequence.at(40, -1).state, State::kMissing);
  EXPECT_EQ(sequence.at(40, 1).state, State::kBeyond);
  EXPECT_EQ(
      place(
          NumberedSequence::list(folder.path(), "", kImageExtensions, Stride::kInferred).at(1, 1)),
      "present 40 40.png");
}

TEST(NumberedSequence, FindsFramesMissingOnesAndTheEnd) {
  const std::tuple<int, int, const char*> cases[] = {{6, -2, "beyond"},
                                                     {6, -1, "present 1 img_000001.jpg"},
                                                     {6, 1, "missing 11 img_000011.jpg"},
                                                     {6, 2, "present 16 img_000016.jpg"},
                                                     {6, 3, "beyond"},
                                                     // A missing frame has paired frames, even past
                                                     // the end: its label says that it exists.
                                                     {11, 0, "missing 11 img_000011.jpg"},
                                                     {11, 1, "present 16 img_000016.jpg"},
                                                     {21, 0, "missing 21 img_000021.jpg"},
                                                     {21, -1, "present 16 img_000016.jpg"}};
  for (const auto& [number, step, found] : cases) {
    EXPECT_EQ(place(every_fifth().at(number, step)), found) << number << " + " << step;
  }
}

TEST(NumberedSequence, FindsByNumberWhateverTheStride) {
  const NumberedSequence sequence = every_fifth();
  EXPECT_EQ(sequence.find(6).state, State::kPresent);
  EXPECT_EQ(sequence.find(7).state, State::kMissing);
  for (const int beyond : {0, 17, -5}) EXPECT_EQ(sequence.find(beyond).state, State::kBeyond);
  EXPECT_EQ(NumberedSequence().find(0).state, State::kBeyond);
  EXPECT_TRUE(sequence.contains(16));
  EXPECT_FALSE(sequence.contains(11));
  EXPECT_FALSE(NumberedSequence().contains(0));
}

}  // namespace
}  // namespace eventgan
