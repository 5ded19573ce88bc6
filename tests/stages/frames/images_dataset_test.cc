#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <string>
#include <vector>

#include "stages/frames/sequences/frames_dataset.h"
#include "stages/frames/sequences/image_folder.h"
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
       {std::pair("notes.txt", "got something else, in "), std::pair("absent", "got nothing, in "),
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
  std::unique_ptr<Dataset> open() const { return open_images_dataset(spec_, folder_.path()); }
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
  EXPECT_EQ(ten.sequence, "");
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

TEST_F(ImagesDatasetTest, TheRateGivesTheTime) {
  touch({"3.png"});
  spec_.frames_per_second = 24;
  EXPECT_EQ(open()->labelled_frames()[0].frame.time_s, 3.0 / 24);
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
