#include <sys/stat.h>

#include <iomanip>
#include <sstream>

#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

TEST(LowerExtension, IsTheLastOneInSmallLetters) {
  EXPECT_EQ(lower_extension("x.Y/a.b.JSON"), ".json");
  EXPECT_EQ(lower_extension("a.mp4"), ".mp4");
  EXPECT_EQ(lower_extension("x.JSON/a"), "");
  EXPECT_EQ(lower_extension(""), "");
}

TEST(NaturalLess, OrdersAsPeopleDo) {
  // Each before all that follow it. "0" and "00", "01" and "1" are equal numbers: their bytes
  // decide.
  const std::vector<std::string> ordered = {
      "",  "0",  "00",   "01",    "1",     "2",   "10", "123456789012345678901",
      "a", "a1", "a1b2", "a1b10", "a02b1", "a10", "b",  "\xC3\xA9"};
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    for (std::size_t k = 0; k < ordered.size(); ++k) {
      EXPECT_EQ(natural_less(ordered[i], ordered[k]), i < k) << ordered[i] << " " << ordered[k];
    }
  }
}

ImageFolder list(const Texts& names) {
  const TemporaryFolder folder;
  for (const std::string& name : names) write_file(folder / name, "");
  return list_image_folder(folder.path());
}

/// "NUMBER NAME, ...".
std::string text_of(const NumberedSequence& sequence) {
  std::string text;
  for (const auto& [number, name] : sequence.frames()) {
    text += (text.empty() ? "" : ", ") + std::to_string(number) + " " + name;
  }
  return text;
}
std::string listed(const Texts& names) { return text_of(list(names).frames); }

TEST(ImageFolder, OnePrefixAndDigitsAreNumbersAndOtherNamesAreCountedInNaturalOrder) {
  EXPECT_EQ(listed({"img_10.png", "img_9.jpg", "img_0012.BMP", "notes.txt"}),
            "9 img_9.jpg, 10 img_10.png, 12 img_0012.BMP");
  EXPECT_EQ(listed({"000005.tif", "000000.tif"}), "0 000000.tif, 5 000005.tif");
  EXPECT_EQ(listed({"b.png", "a10.png", "a9.png"}), "0 a9.png, 1 a10.png, 2 b.png");
  EXPECT_EQ(listed({"a7.png", "b3.png"}), "0 a7.png, 1 b3.png") << "two prefixes";
  EXPECT_EQ(listed({"7.png", "07.png"}), "0 07.png, 1 7.png") << "a number written in two ways";
  EXPECT_EQ(listed({"1234567890123456789.png"}), "0 1234567890123456789.png")
      << "no number's digits";
  EXPECT_EQ(listed({}), "");
}

TEST(ImageFolder, OfTwoImagesOfOneNameTheFirstExtensionCountsAndAPngWhichMayBeAMaskGivesWay) {
  EXPECT_EQ(listed({"a.bmp", "a.webp", "a.jpg"}), "0 a.jpg");
  EXPECT_EQ(listed({"a.jpg", "a.png", "a.bmp"}), "0 a.jpg");
  EXPECT_EQ(listed({"a.PNG", "a.ppm"}), "0 a.ppm");
  EXPECT_EQ(listed({"a.png", "a.PNG"}), "0 a.PNG");
}

TEST(ImageFolder, FindsSidecarsAndFoldersAndPassesOverHiddenEntries) {
  const auto folder = list({"1.png", "1.json", "other.JSON", "two.json", "two.Json", ".2.png",
                            ".git/x", "z/1.png", "y/1.png"});
  EXPECT_THAT(folder.sidecars, ElementsAre(Pair("1", "1.json"), Pair("other", "other.JSON"),
                                           Pair("two", "two.Json")));
  EXPECT_THAT(folder.folders, ElementsAre("y", "z"));
  EXPECT_EQ(text_of(folder.frames), "1 1.png");
}

TEST(ImageFolder, TellsWhatItLeavesOut) {
  const auto folder = list({"1.jpg", "1.png", "1.json", "2.webp", "2.JSON", "2.json", "3.gif",
                            "notes.txt", ".hidden", "sub/1.png"});
  EXPECT_EQ(text_of(folder.frames), "1 1.jpg, 2 2.webp");
  EXPECT_THAT(folder.left_out, ElementsAre("1.png", "2.json", "3.gif", "notes.txt"));
}

/// "NAME: NUMBER FILE, ...", and " by STEP" if a step is no number, " at TIME, ..." in seconds if
/// they have times; whether the names tell them goes to `are_told`.
Texts sequences(const Texts& names, bool are_told = true) {
  const NamedSequences found = name_sequences(list(names).frames);
  EXPECT_EQ(found.are_told, are_told) << names[0];
  Texts texts;
  for (const NamedSequence& sequence : found.sequences) {
    std::ostringstream text;
    text << std::setprecision(9) << sequence.name << ": " << text_of(sequence.frames);
    if (sequence.frames.stride() != 1) text << " by " << sequence.frames.stride();
    for (std::size_t i = 0; i < sequence.times_s.size(); ++i) {
      text << (i == 0 ? " at " : ", ") << std::round(sequence.times_s[i] * 1e9) / 1e9;
    }
    texts.push_back(text.str());
  }
  return texts;
}

TEST(NameSequences, AreWhatNamesSayBeforeTheNumber) {
  // KITTI's flow, Cityscapes, MOT17 made flat, VisDrone, Roboflow.
  EXPECT_THAT(sequences({"000000_10.png", "000000_11.png", "000001_10.png", "000001_11.png"}),
              ElementsAre("000000: 10 000000_10.png, 11 000000_11.png",
                          "000001: 10 000001_10.png, 11 000001_11.png"));
  EXPECT_THAT(sequences({"a_000000_000019_leftImg8bit.png", "a_000000_000020_leftImg8bit.png",
                         "a_000001_000019_leftImg8bit.png", "a_000001_000021_leftImg8bit.png"}),
              ElementsAre("a_000000: 19 a_000000_000019_leftImg8bit.png, "
                          "20 a_000000_000020_leftImg8bit.png",
                          "a_000001: 19 a_000001_000019_leftImg8bit.png, "
                          "21 a_000001_000021_leftImg8bit.png"));
  EXPECT_THAT(
      sequences({"left_1.png", "left_2.png", "right_1.png", "right_2.png"}),
      ElementsAre("left: 1 left_1.png, 2 left_2.png", "right: 1 right_1.png, 2 right_2.png"));
  EXPECT_THAT(sequences({"a_mp4-9_jpg.rf.0f3c.jpg", "a_mp4-10_jpg.rf.99e1.jpg"}),
              ElementsAre(": 9 a_mp4-9_jpg.rf.0f3c.jpg, 10 a_mp4-10_jpg.rf.99e1.jpg"));
  EXPECT_THAT(
      sequences({"3l.png", "4l.png", "3r.png", "4r.png", "cover.png"}),
      ElementsAre("*l: 3 3l.png, 4 4l.png", "*r: 3 3r.png, 4 4r.png", "cover: 0 cover.png"));
  // Numbers alone are the folder's own.
  EXPECT_THAT(sequences({"1.png", "2.png", "thumb.png"}),
              ElementsAre(": 1 1.png, 2 2.png", "thumb: 0 thumb.png"));
}

TEST(NameSequences, TheSmallestStepOfASequenceIsOneFrame) {
  // Of two frames alone it is the folder's.
  EXPECT_THAT(sequences({"a_0.png", "a_10.png", "a_30.png", "b_4.png", "b_9.png", "c_7.png"}),
              ElementsAre("a: 0 a_0.png, 10 a_10.png, 30 a_30.png by 10",
                          "b: 4 b_4.png, 9 b_9.png by 5", "c: 7 c_7.png"));
  EXPECT_THAT(sequences({"a_1.png", "a_2.png", "b_1.png", "b_9.png"}),
              ElementsAre("a: 1 a_1.png, 2 a_2.png", "b: 1 b_1.png, 9 b_9.png"));
  // It is of numbered sequences alone: one has a number twice, one has times a nanosecond apart.
  EXPECT_THAT(
      sequences({"img1.png", "img01.png", "b_4.png", "b_14.png", "t_1403636579763555584.png",
                 "t_1403636579763555585.png"}),
      ElementsAre("b: 4 b_4.png, 14 b_14.png by 10", "img: 0 img01.png, 1 img1.png",
                  "t: 0 t_1403636579763555584.png, 1 t_1403636579763555585.png at 0, 1e-09"));
}

TEST(NameSequences, NamesThatTellNoneAreOneInNaturalOrder) {
  EXPECT_THAT(sequences({"0f3c-9.png", "77ab-2.png", "ffff-2.png"}, false),
              ElementsAre(": 0 0f3c-9.png, 1 77ab-2.png, 2 ffff-2.png"));
  EXPECT_THAT(sequences({"first.png", "second.png"}, false),
              ElementsAre(": 0 first.png, 1 second.png"));
  EXPECT_THAT(sequences({"only.png"}), ElementsAre(": 0 only.png"));
  EXPECT_THAT(sequences({"07.png", "7.png"}), ElementsAre(": 0 07.png, 1 7.png"));
  EXPECT_THAT(name_sequences({}).sequences, IsEmpty());
}

TEST(NameSequences, TimesLackNoFrame) {
  // TUM's and Argoverse's seconds, nuScenes' microseconds, EuRoC's nanoseconds, milliseconds.
  EXPECT_THAT(sequences({"315971930.9.png", "315971931.123456.png", "315971931.5.png"}),
              ElementsAre(": 0 315971930.9.png, 1 315971931.123456.png, 2 315971931.5.png at 0, "
                          "0.223456, 0.6"));
  EXPECT_THAT(sequences({"n__BACK__1532402927612460.jpg", "n__BACK__1532402928112460.jpg",
                         "n__FRONT__1532402927612460.jpg"}),
              ElementsAre("n__BACK: 0 n__BACK__1532402927612460.jpg, "
                          "1 n__BACK__1532402928112460.jpg at 0, 0.5",
                          "n__FRONT: 0 n__FRONT__1532402927612460.jpg at 0"));
  EXPECT_THAT(sequences({"1403636579763555584.png", "1403636579813555456.png"}),
              ElementsAre(": 0 1403636579763555584.png, 1 1403636579813555456.png at 0, "
                          "0.049999872"));
  EXPECT_THAT(sequences({"1403636579763.png", "1403636580000.png"}),
              ElementsAre(": 0 1403636579763.png, 1 1403636580000.png at 0, 0.237"));
  // A date is no time since an epoch: its digits carry at 60. It lacks no frame either.
  EXPECT_THAT(sequences({"20200101095959.png", "20200101100000.png"}),
              ElementsAre(": 0 20200101095959.png, 1 20200101100000.png"));
}

TEST(OpenFramesDataset, OpensFoldersAndRefusesWhatIsNeitherFolderNorVideo) {
  const TemporaryFolder folder;
  for (const char* name : {"clip/1.png", "notes.txt", "broken.mp4"}) write_file(folder / name, "");
  write_file(folder / "text.mp4", std::string(4000, 'x'));
  SourceSpec spec;
  spec.root = "clip";
  EXPECT_EQ(open_frames_dataset(spec, folder.path())->labelled_frames().size(), 1u);
  for (const auto& [root, got] :
       {std::pair("notes.txt",
                  "expected a video (mp4, avi, mov, mkv, webm, m4v, mpg, mpeg, ts, mts, wmv, flv, "
                  "gif), a folder of images, of such folders, or of videos, got something else, "
                  "in "),
        {"absent", "got nothing, in "},
        {"notes.txt/absent.mp4", "got nothing, in "},
        {"broken.mp4", "expected a video"},
        {"text.mp4", "expected a video"}}) {
    spec.root = root;
    EXPECT_THROWS(open_frames_dataset(spec, folder.path()), InputError, got) << root;
  }
}

class ImagesDatasetTest : public FolderTest {
 protected:
  ImagesDatasetTest() { spec_.root = "clip"; }
  void clip(const Texts& names) const {
    for (const std::string& name : names) write("clip/" + name);
  }
  std::unique_ptr<Dataset> open() const { return open(folder_.path()); }
  std::unique_ptr<Dataset> open(const fs::path& base) const {
    return open_images_dataset(spec_, base, list_image_folder(base / spec_.root));
  }
  Texts ids() const { return ids_of(*open()); }

  SourceSpec spec_;
};

TEST_F(ImagesDatasetTest, EveryImageIsASample) {
  clip({"f9.png", "f10.png", "f12.png"});
  EXPECT_THAT(ids(), ElementsAre("f10", "f12", "f9"));
  const auto dataset = open();
  EXPECT_EQ(text_of(dataset->labelled_frames()[0]), "f10 of clip: clip/f10.png 10 by f10.png");
  EXPECT_TRUE(std::isnan(dataset->labelled_frames()[0].frame.time_s));
  EXPECT_THAT(paired(*dataset, 0, {-1, 0, 1, 2, 3}),
              ElementsAre("present clip/f9.png 9", "present clip/f10.png 10",
                          "missing clip/f11.png 11", "present clip/f12.png 12", "beyond"));
  EXPECT_THAT(dataset->annotation_files(), IsEmpty());
}

TEST_F(ImagesDatasetTest, AMissingFrameHasTheNameItWouldHave) {
  clip({"a_000001_000019_leftImg8bit.png", "a_000001_000021_leftImg8bit.png",
        "a_000002_000019_leftImg8bit.png", "a_000002_000020_leftImg8bit.png"});
  EXPECT_THAT(paired(*open(), 0, {1}),
              ElementsAre("missing clip/a_000001_000020_leftImg8bit.png 20"));
}

TEST_F(ImagesDatasetTest, TheRateGivesTheTimeByFramesNotNumbers) {
  clip({"3.png"});
  spec_.frames_per_second = 24;
  EXPECT_EQ(open()->labelled_frames()[0].frame.time_s, 3.0 / 24);
  fs::remove(at("clip/3.png"));
  clip({"7959.png", "7961.png", "7963.png"});
  spec_.frames_per_second = 15;
  const auto dataset = open();
  const LabelledFrame& last = dataset->labelled_frames()[2];
  EXPECT_NEAR(last.frame.time_s - dataset->paired_frame(last, -1).frame.time_s, 1 / 15., 1e-9);
}

TEST_F(ImagesDatasetTest, NamesThatAreTimesGiveThem) {
  clip({"1305031102.175304.png", "1305031102.211214.png"});
  EXPECT_NEAR(open()->labelled_frames()[1].frame.time_s, 0.03591, 1e-9);
  spec_.frames_per_second = 30;
  EXPECT_DOUBLE_EQ(open()->labelled_frames()[1].frame.time_s, 1 / 30.);
}

TEST_F(ImagesDatasetTest, NoPairGoesFromOneSequenceToAnother) {
  clip({"a_1.png", "a_2.png", "a_4.png", "b_1.png", "b_2.png"});
  EXPECT_THAT(ids(), ElementsAre("a_1", "a_2", "a_4", "b_1", "b_2"));
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[2].sequence, "a");
  EXPECT_EQ(dataset->labelled_frames()[3].sequence, "b");
  EXPECT_THAT(paired(*dataset, 2, {-1, 1}), ElementsAre("missing clip/a_3.png 3", "beyond"));
  EXPECT_THAT(paired(*dataset, 3, {-1, 1}), ElementsAre("beyond", "present clip/b_2.png 2"));
}

TEST_F(ImagesDatasetTest, NoSequenceTakesTheNameOfAnother) {
  clip({"000.png", "001.png", "clip_000.png", "clip_001.png"});
  const auto dataset = open();
  ASSERT_THAT(ids(), ElementsAre("000", "001", "clip_000", "clip_001"));
  EXPECT_EQ(dataset->labelled_frames()[0].sequence, "clip*");
  EXPECT_EQ(dataset->labelled_frames()[2].sequence, "clip");
  EXPECT_THAT(paired(*dataset, 0, {1}), ElementsAre("present clip/001.png 1"));
  EXPECT_THAT(paired(*dataset, 2, {1}), ElementsAre("present clip/clip_001.png 1"));
}

TEST_F(ImagesDatasetTest, TheOnlySequenceIsCalledAsItsFolder) {
  clip({"highway/images/1.png", "highway/images/2.png"});
  for (const char* root :
       {"clip/highway/images", "clip/highway/images/", "clip/highway/images/."}) {
    spec_.root = root;
    EXPECT_EQ(open()->labelled_frames()[0].sequence, "highway") << root;
  }
  // Wherever the manifest lies, it says the same.
  spec_.root = ".";
  EXPECT_EQ(open(at("clip/highway/images"))->labelled_frames()[0].sequence, "frames");
}

TEST_F(ImagesDatasetTest, ImagesMayHaveLessUsualExtensions) {
  images({"clip/1.png", "2.jpg", "3.jpg"}, {6, 8});
  write("clip/4.ppm", "P6\n8 6\n255\n" + std::string(3 * 6 * 8, 'x'));
  fs::rename(at("2.jpg"), at("clip/2.jfif"));
  fs::rename(at("3.jpg"), at("clip/3.MPO"));
  EXPECT_THAT(ids(), ElementsAre("1", "2", "3", "4"));
  const auto dataset = open();
  for (const LabelledFrame& labelled : dataset->labelled_frames()) {
    const auto size = probe_image_size(at(labelled.frame.path), ImageOrientation::kUpright);
    ASSERT_EQ(fault_of(size), "no fault");
    EXPECT_EQ(*size, (ImageSize{6, 8})) << labelled.frame.path;
  }
}

TEST_F(ImagesDatasetTest, StillsAreOfNoSequence) {
  clip({"2007_1.png", "2008_1.png", "2008_2.png"});
  spec_.pairs.stills.emplace();
  const auto dataset = open();
  for (const LabelledFrame& frame : dataset->labelled_frames()) EXPECT_EQ(frame.sequence, "");
}

TEST_F(ImagesDatasetTest, SaysWhereNamesTellNoSequences) {
  clip({"0f-9.png", "7b-2.png", "ff-2.png"});
  EXPECT_THAT(open()->notes(), ElementsAre("names of images tell no sequences: 3 images in the "
                                           "order of their names in clip"));
  EXPECT_EQ(open()->labelled_frames()[0].sequence, "clip");
}

TEST_F(ImagesDatasetTest, FoldersMayBeTwoDeep) {
  clip({"day/a/1.png", "day/a/2.png", "day/b/1.png", "night/1.png", "night/c/1.png", "x/y/z.txt"});
  EXPECT_THAT(ids(), ElementsAre("day/a/1", "day/a/2", "day/b/1", "night/1"));
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[1].sequence, "day/a");
  EXPECT_THAT(paired(*dataset, 1, {-1}), ElementsAre("present clip/day/a/1.png 1"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 folder left out in clip/night: c", "1 folder left out in clip/x: y",
                          "1 folder without images in clip"));
}

TEST_F(ImagesDatasetTest, EachFolderIsASequence) {
  clip({"b/1.png", "a/1.png", "a/2.png", "empty/readme.txt"});
  EXPECT_THAT(ids(), ElementsAre("a/1", "a/2", "b/1"));
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[1].sequence, "a");
  EXPECT_THAT(paired(*dataset, 1, {-1, 0, 1}),
              ElementsAre("present clip/a/1.png 1", "present clip/a/2.png 2", "beyond"))
      << "never into the next folder";
  EXPECT_THAT(dataset->notes(), ElementsAre("1 file left out in clip/empty: readme.txt",
                                            "1 folder without images in clip"));
}

TEST_F(ImagesDatasetTest, ImagesBesideFoldersCount) {
  clip({"1.png", "a/1.png"});
  EXPECT_THAT(ids(), ElementsAre("1"));
  EXPECT_THAT(open()->notes(), ElementsAre("1 folder beside the images left out in clip"));
}

TEST_F(ImagesDatasetTest, WhatIsLeftOutIsCountedAndNamed) {
  clip({"a/001.png", "a/002.png", "a/002.jpg", "a/009.json", "b/1.webp", "b/1.txt", "b/10.json",
        "b/11.json", "b/deeper/1.png", "readme.md"});
  const auto dataset = open();
  EXPECT_THAT(ids(), ElementsAre("a/001", "a/002", "b/1"));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 file left out in clip: readme.md",
                                            "2 files left out in clip/a: 002.png, 009.json",
                                            "1 folder left out in clip/b: deeper",
                                            "3 files left out in clip/b: 1.txt, 10.json, 11.json"));
}

TEST_F(ImagesDatasetTest, PassesSidecarsThroughByteForByte) {
  clip({"a/1.png", "a/2.png", "a/3.png"});
  const std::string label = "{ \"k\" : 1.50,\n \"l\": [] }\r\n";
  write("clip/a/1.json", label);
  write("clip/a/2.json", "{");
  const auto dataset = open();
  EXPECT_EQ(annotation_of(*dataset), (Annotation{label, {}, {}}));
  EXPECT_THAT(fault_of(*dataset, 1), HasSubstr("clip/a/2.json"));
  EXPECT_EQ(annotation_of(*dataset, 2).original, "");
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("clip/a/1.json", "clip/a/2.json"));
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key), "clip/a/1.json");
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[2].label_key), "clip/a/3.png");
  // A label that is there when the plan is made must still be there later.
  fs::remove(at("clip/a/1.json"));
  EXPECT_THAT(fault_of(*dataset), HasSubstr("expected a readable file"));
}

TEST_F(ImagesDatasetTest, ASidecarsExtensionMayBeInCapitals) {
  clip({"1.png", "unrelated.json"});
  write("clip/1.JSON", "[7]");
  EXPECT_EQ(annotation_of(*open()), (Annotation{"[7]", {}, {}}));
  EXPECT_THAT(open()->annotation_files(), ElementsAre("clip/1.JSON"));
}

TEST_F(ImagesDatasetTest, ALabelThatIsNoSoundJsonFileIsAFault) {
  clip({"1.png"});
  const fs::path label = at("clip/1.json");
  for (const auto& [text, fault] :
       {std::pair(std::string(100'000, '[') + std::string(100'000, ']'),
                  "expected at most 32 levels of nesting, got more"),
        {R"({"a": 1, "a": 2})", "clip/1.json: $.a: expected the key once, got it twice"},
        {"{} // a comment is no JSON", "clip/1.json:1:4: expected JSON, got"},
        {"\xef\xbb\xbf{}", "no fault"}}) {
    write_file(label, text);
    EXPECT_THAT(fault_of(*open()), HasSubstr(fault));
  }
  fs::remove(label);
  ASSERT_EQ(::mkfifo(label.c_str(), 0600), 0);
  EXPECT_EQ(fault_of(*open()),
            "expected a readable file, got 'Not a regular file', in clip/1.json");
  fs::remove(label);
  fs::create_directory(label);
  EXPECT_EQ(fault_of(*open()), "expected a readable file, got 'Is a directory', in clip/1.json");
  EXPECT_THAT(open()->notes(), IsEmpty()) << "it is taken, not left out";
}

TEST_F(ImagesDatasetTest, RefusesAFolderWithoutImages) {
  clip({"readme.txt", "a/readme.txt"});
  EXPECT_THROWS(open(), InputError, "got none, in ");
}

}  // namespace
}  // namespace eventgan
