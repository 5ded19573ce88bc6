#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <string>
#include <vector>

#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::ThrowsMessage;

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

using Frame = NumberedSequence::Frame;

ImageFolder list(const std::vector<std::string>& names) {
  const testing::TemporaryFolder folder;
  for (const std::string& name : names) testing::write_file(folder / name, "");
  return list_image_folder(folder.path());
}

TEST(ImageFolder, OnePrefixAndDigitsAreNumbers) {
  EXPECT_THAT(
      list({"img_10.png", "img_9.jpg", "img_0012.BMP", "notes.txt"}).frames.frames(),
      ElementsAre(Frame(9, "img_9.jpg"), Frame(10, "img_10.png"), Frame(12, "img_0012.BMP")));
  EXPECT_THAT(list({"000005.tif", "000000.tif"}).frames.frames(),
              ElementsAre(Frame(0, "000000.tif"), Frame(5, "000005.tif")));
}

TEST(ImageFolder, OtherNamesAreCountedInNaturalOrder) {
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

TEST(ImageFolder, OfTwoImagesOfOneNameTheFirstExtensionCounts) {
  EXPECT_THAT(list({"a.jpg", "a.png", "a.bmp"}).frames.frames(), ElementsAre(Frame(0, "a.png")));
  EXPECT_THAT(list({"a.png", "a.PNG"}).frames.frames(), ElementsAre(Frame(0, "a.PNG")));
}

TEST(ImageFolder, FindsSidecarsAndFoldersAndPassesOverHiddenEntries) {
  const auto folder = list({"1.png", "1.json", "other.JSON", "two.json", "two.Json", ".2.png",
                            ".git/x", "z/1.png", "y/1.png"});
  EXPECT_THAT(folder.sidecars, ElementsAre(Pair("1", "1.json"), Pair("other", "other.JSON"),
                                           Pair("two", "two.Json")));
  EXPECT_THAT(folder.folders, ElementsAre("y", "z"));
  EXPECT_THAT(folder.frames.frames(), ElementsAre(Frame(1, "1.png")));
}

TEST(ImageFolder, TellsWhatItLeavesOut) {
  const auto folder = list({"1.jpg", "1.png", "1.json", "2.webp", "2.JSON", "2.json", "3.gif",
                            "notes.txt", ".hidden", "sub/1.png"});
  EXPECT_THAT(folder.frames.frames(), ElementsAre(Frame(1, "1.png"), Frame(2, "2.webp")));
  EXPECT_THAT(folder.left_out, ElementsAre("1.jpg", "2.json", "3.gif", "notes.txt"));
}

TEST(ImageFolder, MayBeEmpty) { EXPECT_THAT(list({}).frames.frames(), IsEmpty()); }

struct Told {
  std::string name;
  std::vector<Frame> frames;
  std::int64_t step = 1;
  std::vector<double> times_s = {};
};

void expect_sequences(const std::vector<std::string>& names, const std::vector<Told>& told,
                      bool are_told = true) {
  const NamedSequences found = name_sequences(list(names).frames);
  EXPECT_EQ(found.are_told, are_told) << names[0];
  ASSERT_EQ(found.sequences.size(), told.size()) << names[0];
  for (std::size_t i = 0; i < told.size(); ++i) {
    const NamedSequence& sequence = found.sequences[i];
    EXPECT_EQ(sequence.name, told[i].name);
    EXPECT_EQ(sequence.frames.frames(), told[i].frames) << told[i].name;
    EXPECT_EQ(sequence.frames.stride(), told[i].step) << told[i].name;
    ASSERT_EQ(sequence.times_s.size(), told[i].times_s.size()) << told[i].name;
    for (std::size_t k = 0; k < told[i].times_s.size(); ++k) {
      EXPECT_NEAR(sequence.times_s[k], told[i].times_s[k], 1e-9) << told[i].name;
    }
  }
}

TEST(NameSequences, AreWhatNamesSayBeforeTheNumber) {
  // KITTI's flow, Cityscapes, MOT17 made flat, VisDrone, Roboflow.
  expect_sequences({"000000_10.png", "000000_11.png", "000001_10.png", "000001_11.png"},
                   {{"000000", {{10, "000000_10.png"}, {11, "000000_11.png"}}},
                    {"000001", {{10, "000001_10.png"}, {11, "000001_11.png"}}}});
  expect_sequences({"aachen_000000_000019_leftImg8bit.png", "aachen_000000_000020_leftImg8bit.png",
                    "aachen_000001_000019_leftImg8bit.png", "aachen_000001_000021_leftImg8bit.png"},
                   {{"aachen_000000",
                     {{19, "aachen_000000_000019_leftImg8bit.png"},
                      {20, "aachen_000000_000020_leftImg8bit.png"}}},
                    {"aachen_000001",
                     {{19, "aachen_000001_000019_leftImg8bit.png"},
                      {21, "aachen_000001_000021_leftImg8bit.png"}}}});
  expect_sequences({"left_1.png", "left_2.png", "right_1.png", "right_2.png"},
                   {{"left", {{1, "left_1.png"}, {2, "left_2.png"}}},
                    {"right", {{1, "right_1.png"}, {2, "right_2.png"}}}});
  expect_sequences({"a_mp4-9_jpg.rf.0f3c.jpg", "a_mp4-10_jpg.rf.99e1.jpg"},
                   {{"", {{9, "a_mp4-9_jpg.rf.0f3c.jpg"}, {10, "a_mp4-10_jpg.rf.99e1.jpg"}}}});
  expect_sequences({"3l.png", "4l.png", "3r.png", "4r.png", "cover.png"},
                   {{"*l", {{3, "3l.png"}, {4, "4l.png"}}},
                    {"*r", {{3, "3r.png"}, {4, "4r.png"}}},
                    {"cover", {{0, "cover.png"}}}});
}

TEST(NameSequences, NumbersAloneAreTheFoldersOwn) {
  expect_sequences({"1.png", "2.png", "thumb.png"},
                   {{"", {{1, "1.png"}, {2, "2.png"}}}, {"thumb", {{0, "thumb.png"}}}});
}

TEST(NameSequences, TheSmallestStepOfASequenceIsOneFrame) {
  // Of two frames alone it is the folder's.
  expect_sequences({"a_0.png", "a_10.png", "a_30.png", "b_4.png", "b_9.png", "c_7.png"},
                   {{"a", {{0, "a_0.png"}, {10, "a_10.png"}, {30, "a_30.png"}}, 10},
                    {"b", {{4, "b_4.png"}, {9, "b_9.png"}}, 5},
                    {"c", {{7, "c_7.png"}}, 1}});
  expect_sequences(
      {"a_1.png", "a_2.png", "b_1.png", "b_9.png"},
      {{"a", {{1, "a_1.png"}, {2, "a_2.png"}}}, {"b", {{1, "b_1.png"}, {9, "b_9.png"}}}});
}

TEST(NameSequences, TheFoldersStepIsOfNumberedSequencesAlone) {
  // One has a number twice, one has times a nanosecond apart.
  expect_sequences(
      {"img1.png", "img01.png", "b_4.png", "b_14.png", "t_1403636579763555584.png",
       "t_1403636579763555585.png"},
      {{"b", {{4, "b_4.png"}, {14, "b_14.png"}}, 10},
       {"img", {{0, "img01.png"}, {1, "img1.png"}}},
       {"t", {{0, "t_1403636579763555584.png"}, {1, "t_1403636579763555585.png"}}, 1, {0, 1e-9}}});
}

TEST(NameSequences, NamesThatTellNoneAreOneInNaturalOrder) {
  expect_sequences({"0f3c-9.png", "77ab-2.png", "ffff-2.png"},
                   {{"", {{0, "0f3c-9.png"}, {1, "77ab-2.png"}, {2, "ffff-2.png"}}}}, false);
  expect_sequences({"first.png", "second.png"}, {{"", {{0, "first.png"}, {1, "second.png"}}}},
                   false);
  expect_sequences({"only.png"}, {{"", {{0, "only.png"}}}});
  expect_sequences({"07.png", "7.png"}, {{"", {{0, "07.png"}, {1, "7.png"}}}});
  EXPECT_THAT(name_sequences({}).sequences, IsEmpty());
}

TEST(NameSequences, TimesLackNoFrame) {
  // TUM's and Argoverse's seconds, nuScenes' microseconds, EuRoC's nanoseconds, milliseconds.
  expect_sequences({"315971930.9.png", "315971931.123456.png", "315971931.5.png"},
                   {{"",
                     {{0, "315971930.9.png"}, {1, "315971931.123456.png"}, {2, "315971931.5.png"}},
                     1,
                     {0, 0.223456, 0.6}}});
  expect_sequences(
      {"n015__CAM_BACK__1532402927612460.jpg", "n015__CAM_BACK__1532402928112460.jpg",
       "n015__CAM_FRONT__1532402927612460.jpg"},
      {{"n015__CAM_BACK",
        {{0, "n015__CAM_BACK__1532402927612460.jpg"}, {1, "n015__CAM_BACK__1532402928112460.jpg"}},
        1,
        {0, 0.5}},
       {"n015__CAM_FRONT", {{0, "n015__CAM_FRONT__1532402927612460.jpg"}}, 1, {0}}});
  expect_sequences({"1403636579763555584.png", "1403636579813555456.png"},
                   {{"",
                     {{0, "1403636579763555584.png"}, {1, "1403636579813555456.png"}},
                     1,
                     {0, 0.049999872}}});
  expect_sequences({"1403636579763.png", "1403636580000.png"},
                   {{"", {{0, "1403636579763.png"}, {1, "1403636580000.png"}}, 1, {0, 0.237}}});
  // A date is no time since an epoch: its digits carry at 60. It lacks no frame either.
  expect_sequences({"20200101095959.png", "20200101100000.png"},
                   {{"", {{0, "20200101095959.png"}, {1, "20200101100000.png"}}}});
}

TEST(OpenFramesDataset, OpensFoldersAndRefusesWhatIsNeitherFolderNorVideo) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "clip/1.png", "");
  testing::write_file(folder / "notes.txt", "");
  testing::write_file(folder / "broken.mp4", "");
  testing::write_file(folder / "text.mp4", std::string(4000, 'x'));
  SourceSpec spec;
  spec.root = "clip";
  EXPECT_EQ(open_frames_dataset(spec, folder.path())->labelled_frames().size(), 1u);
  for (const auto& [root, got] :
       {std::pair("notes.txt",
                  "expected a video (mp4, avi, mov, mkv, webm, m4v, mpg, mpeg, ts, "
                  "mts, wmv, flv, gif), a folder of images, of such folders, or of "
                  "videos, got something else, in "),
        std::pair("absent", "got nothing, in "),
        std::pair("notes.txt/absent.mp4", "got nothing, in ")}) {
    spec.root = root;
    EXPECT_THAT([&] { open_frames_dataset(spec, folder.path()); },
                ThrowsMessage<InputError>(HasSubstr(got)))
        << root;
  }
  for (const char* root : {"broken.mp4", "text.mp4"}) {
    spec.root = root;
    EXPECT_THAT([&] { open_frames_dataset(spec, folder.path()); },
                ThrowsMessage<InputError>(HasSubstr("expected a video")))
        << root;
  }
}

using State = PairedFrame::State;

class ImagesDatasetTest : public ::testing::Test {
 protected:
  ImagesDatasetTest() { spec_.root = "clip"; }
  void touch(const std::vector<std::string>& names) const {
    for (const std::string& name : names) testing::write_file(folder_ / ("clip/" + name), "");
  }
  std::unique_ptr<Dataset> open() const { return open(folder_.path()); }
  std::unique_ptr<Dataset> open(const std::filesystem::path& base) const {
    return open_images_dataset(spec_, base, list_image_folder(base / spec_.root));
  }
  std::vector<std::string> ids() const {
    std::vector<std::string> found;
    const auto dataset = open();
    for (const auto& frame : dataset->labelled_frames()) found.push_back(frame.sample_id);
    return found;
  }

  testing::TemporaryFolder folder_;
  SourceSpec spec_;
};

TEST_F(ImagesDatasetTest, EveryImageIsASample) {
  touch({"f9.png", "f10.png", "f12.png"});
  EXPECT_THAT(ids(), ElementsAre("f10", "f12", "f9"));
  const auto dataset = open();
  const LabelledFrame& ten = dataset->labelled_frames()[0];
  EXPECT_EQ(ten.sequence, "clip");
  EXPECT_EQ(ten.frame, (FrameRef{"clip/f10.png", 10}));
  EXPECT_TRUE(std::isnan(ten.frame.time_s));
  EXPECT_EQ(dataset->paired_frame(ten, 0).frame, ten.frame);
  EXPECT_EQ(dataset->paired_frame(ten, -1).frame, (FrameRef{"clip/f9.png", 9}));
  EXPECT_EQ(dataset->paired_frame(ten, 1).state, State::kMissing);
  EXPECT_EQ(dataset->paired_frame(ten, 1).frame.path, "clip/f11.png");
  EXPECT_EQ(dataset->paired_frame(ten, 2).frame, (FrameRef{"clip/f12.png", 12}));
  EXPECT_EQ(dataset->paired_frame(ten, 3).state, State::kBeyond);
  EXPECT_THAT(dataset->annotation_files(), IsEmpty());
}

TEST_F(ImagesDatasetTest, AMissingFrameHasTheNameItWouldHave) {
  touch({"a_000001_000019_leftImg8bit.png", "a_000001_000021_leftImg8bit.png",
         "a_000002_000019_leftImg8bit.png", "a_000002_000020_leftImg8bit.png"});
  const auto dataset = open();
  const PairedFrame next = dataset->paired_frame(dataset->labelled_frames()[0], 1);
  EXPECT_EQ(next.state, State::kMissing);
  EXPECT_EQ(next.frame.path, "clip/a_000001_000020_leftImg8bit.png");
}

TEST_F(ImagesDatasetTest, TheRateGivesTheTime) {
  touch({"3.png"});
  spec_.frames_per_second = 24;
  EXPECT_EQ(open()->labelled_frames()[0].frame.time_s, 3.0 / 24);
}

TEST_F(ImagesDatasetTest, TheRateCountsFramesNotNumbers) {
  touch({"7959.png", "7961.png", "7963.png"});
  spec_.frames_per_second = 15;
  const auto dataset = open();
  const LabelledFrame& last = dataset->labelled_frames()[2];
  EXPECT_NEAR(last.frame.time_s - dataset->paired_frame(last, -1).frame.time_s, 1 / 15., 1e-9);
}

TEST_F(ImagesDatasetTest, NamesThatAreTimesGiveThem) {
  touch({"1305031102.175304.png", "1305031102.211214.png"});
  EXPECT_NEAR(open()->labelled_frames()[1].frame.time_s, 0.03591, 1e-9);
  spec_.frames_per_second = 30;
  EXPECT_DOUBLE_EQ(open()->labelled_frames()[1].frame.time_s, 1 / 30.);
}

TEST_F(ImagesDatasetTest, NoPairGoesFromOneSequenceToAnother) {
  touch({"a_1.png", "a_2.png", "a_4.png", "b_1.png", "b_2.png"});
  EXPECT_THAT(ids(), ElementsAre("a_1", "a_2", "a_4", "b_1", "b_2"));
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  EXPECT_EQ(frames[2].sequence, "a");
  EXPECT_EQ(frames[3].sequence, "b");
  EXPECT_EQ(dataset->paired_frame(frames[2], -1).state, State::kMissing);
  EXPECT_EQ(dataset->paired_frame(frames[2], 1).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(frames[3], -1).state, State::kBeyond);
  EXPECT_EQ(dataset->paired_frame(frames[3], 1).frame, (FrameRef{"clip/b_2.png", 2}));
}

TEST_F(ImagesDatasetTest, NoSequenceTakesTheNameOfAnother) {
  touch({"000.png", "001.png", "clip_000.png", "clip_001.png"});
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  ASSERT_THAT(ids(), ElementsAre("000", "001", "clip_000", "clip_001"));
  EXPECT_EQ(frames[0].sequence, "clip*");
  EXPECT_EQ(frames[2].sequence, "clip");
  EXPECT_EQ(dataset->paired_frame(frames[0], 1).frame.path, "clip/001.png");
  EXPECT_EQ(dataset->paired_frame(frames[2], 1).frame.path, "clip/clip_001.png");
}

TEST_F(ImagesDatasetTest, TheOnlySequenceIsCalledAsItsFolder) {
  touch({"highway/images/1.png", "highway/images/2.png"});
  const auto sequence = [&](const std::string& root) {
    spec_.root = root;
    return open()->labelled_frames()[0].sequence;
  };
  EXPECT_EQ(sequence("clip/highway/images"), "highway");
  EXPECT_EQ(sequence("clip/highway/images/"), "highway");
  EXPECT_EQ(sequence("clip/highway/images/."), "highway");
  // Wherever the manifest lies, it says the same.
  spec_.root = ".";
  EXPECT_EQ(open(folder_ / "clip/highway/images")->labelled_frames()[0].sequence, "frames");
}

TEST_F(ImagesDatasetTest, ImagesMayHaveLessUsualExtensions) {
  testing::write_flat_image(folder_ / "clip/1.png", ImageSize{6, 8}, 9);
  testing::write_file(folder_ / "clip/4.ppm", "P6\n8 6\n255\n" + std::string(3 * 6 * 8, 'x'));
  for (const auto& [format, name] : {std::pair("jpg", "2.jfif"), std::pair("jpg", "3.MPO")}) {
    const fs::path written = folder_ / (std::string("image.") + format);
    testing::write_flat_image(written, ImageSize{6, 8}, 9);
    fs::rename(written, folder_ / "clip" / name);
  }
  EXPECT_THAT(ids(), ElementsAre("1", "2", "3", "4"));
  const auto dataset = open();
  for (const LabelledFrame& labelled : dataset->labelled_frames()) {
    const auto size = probe_image_size(folder_ / labelled.frame.path, ImageOrientation::kUpright);
    ASSERT_FALSE(is_fault(size)) << size.fault().reason;
    EXPECT_EQ(*size, (ImageSize{6, 8})) << labelled.frame.path;
  }
}

TEST_F(ImagesDatasetTest, StillsAreOfNoSequence) {
  touch({"2007_1.png", "2008_1.png", "2008_2.png"});
  spec_.pairs.stills.emplace();
  const auto dataset = open();
  for (const LabelledFrame& frame : dataset->labelled_frames()) EXPECT_EQ(frame.sequence, "");
}

TEST_F(ImagesDatasetTest, SaysWhereNamesTellNoSequences) {
  touch({"0f-9.png", "7b-2.png", "ff-2.png"});
  EXPECT_THAT(open()->notes(), ElementsAre("names of images tell no sequences: 3 images in the "
                                           "order of their names in clip"));
  EXPECT_EQ(open()->labelled_frames()[0].sequence, "clip");
}

TEST_F(ImagesDatasetTest, FoldersMayBeTwoDeep) {
  touch({"day/a/1.png", "day/a/2.png", "day/b/1.png", "night/1.png", "night/c/1.png", "x/y/z.txt"});
  EXPECT_THAT(ids(), ElementsAre("day/a/1", "day/a/2", "day/b/1", "night/1"));
  const auto dataset = open();
  EXPECT_EQ(dataset->labelled_frames()[1].sequence, "day/a");
  EXPECT_EQ(dataset->paired_frame(dataset->labelled_frames()[1], -1).frame,
            (FrameRef{"clip/day/a/1.png", 1}));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 folder left out in clip/night: c", "1 folder left out in clip/x: y",
                          "1 folder without images in clip"));
}

TEST_F(ImagesDatasetTest, EachFolderIsASequence) {
  touch({"b/1.png", "a/1.png", "a/2.png", "empty/readme.txt"});
  EXPECT_THAT(ids(), ElementsAre("a/1", "a/2", "b/1"));
  const auto dataset = open();
  const LabelledFrame& last = dataset->labelled_frames()[1];
  EXPECT_EQ(last.sequence, "a");
  EXPECT_EQ(last.frame.path, "clip/a/2.png");
  EXPECT_EQ(dataset->paired_frame(last, -1).frame.path, "clip/a/1.png");
  EXPECT_EQ(dataset->paired_frame(last, 1).state, State::kBeyond);  // never into the next folder
  EXPECT_THAT(dataset->notes(), ElementsAre("1 file left out in clip/empty: readme.txt",
                                            "1 folder without images in clip"));
}

TEST_F(ImagesDatasetTest, ImagesBesideFoldersCount) {
  touch({"1.png", "a/1.png"});
  EXPECT_THAT(ids(), ElementsAre("1"));
  EXPECT_THAT(open()->notes(), ElementsAre("1 folder beside the images left out in clip"));
}

TEST_F(ImagesDatasetTest, WhatIsLeftOutIsCountedAndNamed) {
  touch({"a/001.png", "a/002.png", "a/002.jpg", "a/009.json", "b/1.webp", "b/1.txt", "b/10.json",
         "b/11.json", "b/deeper/1.png", "readme.md"});
  const auto dataset = open();
  EXPECT_THAT(ids(), ElementsAre("a/001", "a/002", "b/1"));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 file left out in clip: readme.md",
                                            "1 label without an image in clip/a: 009.json",
                                            "1 file left out in clip/a: 002.jpg",
                                            "2 labels without an image in clip/b: 10.json, 11.json",
                                            "1 folder left out in clip/b: deeper",
                                            "1 file left out in clip/b: 1.txt"));
}

TEST_F(ImagesDatasetTest, PassesSidecarsThroughByteForByte) {
  touch({"a/1.png", "a/2.png", "a/3.png"});
  const std::string label = "{ \"k\" : 1.50,\n \"l\": [] }\r\n";
  testing::write_file(folder_ / "clip/a/1.json", label);
  testing::write_file(folder_ / "clip/a/2.json", "{");
  const auto dataset = open();
  const auto annotation = [&](int i) {
    return dataset->annotation(dataset->labelled_frames()[i].label_key);
  };
  const auto first = *annotation(0);
  EXPECT_EQ(first.original, label);
  EXPECT_TRUE(first.boxes.empty() && first.persons.empty());
  ASSERT_TRUE(is_fault(annotation(1)));
  EXPECT_THAT(annotation(1).fault().reason, HasSubstr("clip/a/2.json"));
  EXPECT_EQ(annotation(2)->original, "");

  EXPECT_THAT(dataset->annotation_files(), ElementsAre("clip/a/1.json", "clip/a/2.json"));
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key), "clip/a/1.json");
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[2].label_key), "clip/a/3.png");

  // A label that is there when the plan is made must still be there later.
  std::filesystem::remove(folder_ / "clip/a/1.json");
  EXPECT_TRUE(is_fault(annotation(0)));
}

TEST_F(ImagesDatasetTest, ASidecarsExtensionMayBeInCapitals) {
  touch({"1.png", "unrelated.json"});
  testing::write_file(folder_ / "clip/1.JSON", "[7]");
  const auto dataset = open();
  EXPECT_EQ(*dataset->annotation(dataset->labelled_frames()[0].label_key),
            (Annotation{"[7]", {}, {}}));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("clip/1.JSON"));
}

TEST_F(ImagesDatasetTest, ALabelThatIsNoSoundJsonFileIsAFault) {
  touch({"1.png"});
  const fs::path label = folder_ / "clip/1.json";
  const auto reason = [&] {
    const auto dataset = open();
    const auto annotation = dataset->annotation(dataset->labelled_frames()[0].label_key);
    return is_fault(annotation) ? annotation.fault().reason : "none";
  };
  const std::string deep = std::string(100'000, '[') + std::string(100'000, ']');
  testing::write_file(label, deep);
  EXPECT_THAT(reason(), HasSubstr("expected at most 32 levels of nesting, got more"));
  testing::write_file(label, R"({"a": 1, "a": 2})");
  EXPECT_EQ(reason(), "clip/1.json: $.a: expected the key once, got it twice");
  testing::write_file(label, "{} // a comment is no JSON");
  EXPECT_THAT(reason(), HasSubstr("clip/1.json:1:4: expected JSON, got"));
  testing::write_file(label, "\xef\xbb\xbf{}");
  EXPECT_EQ(reason(), "none");

  fs::remove(label);
  ASSERT_EQ(::mkfifo(label.c_str(), 0600), 0);
  EXPECT_EQ(reason(), "expected a readable file, got 'Not a regular file', in clip/1.json");
  fs::remove(label);
  fs::create_directory(label);
  EXPECT_EQ(reason(), "expected a readable file, got 'Is a directory', in clip/1.json");
  EXPECT_THAT(open()->notes(), ::testing::IsEmpty()) << "it is taken, not left out";
}

TEST_F(ImagesDatasetTest, RefusesAFolderWithoutImages) {
  touch({"readme.txt", "a/readme.txt"});
  EXPECT_THAT([&] { open(); }, ThrowsMessage<InputError>(HasSubstr("got none, in ")));
}

}  // namespace
}  // namespace eventgan
