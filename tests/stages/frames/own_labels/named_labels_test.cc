#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "stages/frames/sequences/frames_dataset.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

/// Images of 40 x 30 and labels in a folder.
class NamedLabels : public ::testing::Test {
 protected:
  void image(const std::string& name) {
    testing::write_flat_image(folder_ / name, ImageSize{30, 40}, 9);
  }
  void text(const std::string& name, const std::string& content) {
    testing::write_file(folder_ / name, content);
  }
  /// As a manifest in that folder would.
  std::unique_ptr<Dataset> open(LabelFormat format, const std::string& root,
                                const std::string& path, const std::string& manifest = "") const {
    SourceSpec spec;
    spec.root = root;
    spec.labels = LabelSpec{format, path};
    return open_frames_dataset(spec, folder_ / manifest);
  }
  static std::string voc(const std::string& name, const std::string& size = "40",
                         const std::string& more = "") {
    return "<annotation><size><width>" + size + "</width><height>30</height></size><object><name>" +
           name +
           "</name><bndbox><xmin>1</xmin><ymin>2</ymin><xmax>3</xmax><ymax>4</ymax></bndbox>" +
           more + "</object></annotation>";
  }

  testing::TemporaryFolder folder_;
};

Annotation read(const Dataset& dataset, const std::string& key) {
  const auto annotation = dataset.annotation(key);
  return is_fault(annotation) ? Annotation{annotation.fault().reason, {}, {}} : *annotation;
}

TEST_F(NamedLabels, VocLiesInAnnotations) {
  const struct {
    const char *root, *path, *image, *label;
  } cases[] = {
      {"VOC/JPEGImages", "VOC", "VOC/JPEGImages/7.jpg", "VOC/Annotations/7.xml"},
      {"VOC/JPEGImages", "VOC/Annotations", "VOC/JPEGImages/7.jpg", "VOC/Annotations/7.xml"},
      {"VOC", "VOC/Annotations", "VOC/JPEGImages/7.jpg", "VOC/Annotations/7.xml"},
      {"d/images", "d/xml", "d/images/a/7.jpg", "d/xml/a/7.xml"},
      {"d", "d", "d/7.jpg", "d/7.xml"},
  };
  for (const auto& layout : cases) {
    std::filesystem::remove_all(folder_ / "VOC");
    std::filesystem::remove_all(folder_ / "d");
    image(layout.image);
    text(layout.label, voc("cat", "40", "<difficult>1</difficult>"));
    const auto dataset = open(LabelFormat::kVoc, layout.root, layout.path);
    ASSERT_EQ(dataset->labelled_frames().size(), 1u) << layout.label;
    EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("cat"));
    EXPECT_THAT(dataset->annotation_files(), ElementsAre(layout.label));
    const std::string key = dataset->labelled_frames()[0].label_key;
    EXPECT_EQ(dataset->label_place(key), layout.label);
    const Annotation annotation = read(*dataset, key);
    ASSERT_EQ(annotation.boxes.size(), 1u) << annotation.original;
    EXPECT_EQ(annotation.boxes[0].xyxy, (Rectangle{0, 1, 3, 4}));
    EXPECT_TRUE(annotation.boxes[0].ignore);
    EXPECT_EQ(annotation.original, voc("cat", "40", "<difficult>1</difficult>"));
  }
}

TEST_F(NamedLabels, ClassesAreNumberedByName) {
  for (const char* name : {"a", "b", "c", "d"}) image("i/" + std::string(name) + ".png");
  text("x/a.xml", voc("dog"));
  text("x/b.xml", voc("cat"));
  text("x/c.xml", voc("bird", "41"));
  text("x/d.xml", "<annotation");
  text("x/gone.xml", voc("ant"));
  const auto dataset = open(LabelFormat::kVoc, "i", "x");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("bird", "cat", "dog"));
  ASSERT_EQ(dataset->labelled_frames().size(), 5u);
  EXPECT_EQ(read(*dataset, "a.xml").boxes.at(0).class_id, 2);
  EXPECT_EQ(read(*dataset, "b.xml").boxes.at(0).class_id, 1);
  EXPECT_EQ(read(*dataset, "c.xml").original,
            "expected an image of 41x30, as x/c.xml says, got 40x30, in i/c.png");
  EXPECT_THAT(read(*dataset, "d.xml").original, HasSubstr("expected XML"));
  EXPECT_EQ(dataset->labelled_frames()[4].sample_id, "gone");
  EXPECT_EQ(dataset->paired_frame(dataset->labelled_frames()[4], 0).frame.path, "i/gone.png");
  text("x/a.xml", voc("eel"));
  EXPECT_THAT(read(*dataset, "a.xml").original, HasSubstr("got \"eel\", in x/a.xml"));
}

/// VOC's file of a cat with these edges.
std::string cat(const std::string& xmin, const std::string& ymin, const std::string& xmax,
                const std::string& more = "") {
  return "<annotation><object><name>cat</name><bndbox><xmin>" + xmin + "</xmin><ymin>" + ymin +
         "</ymin><xmax>" + xmax + "</xmax><ymax>20</ymax></bndbox>" + more +
         "</object></annotation>";
}

TEST_F(NamedLabels, OneEdgeAt0TellsThatVocsCountFrom0) {
  const struct {
    const char *first, *second;
    std::optional<int> edges_from;
    double left;
    const char* note;
  } cases[] = {
      {"10", "5", {}, 9, "edges count from 1 in x, as Pascal VOC's do, since none is at 0"},
      {"10", "0", {}, 10, "edges count from 0 in x, since one is at 0 in x/2.xml"},
      {"10", "0.5", {}, 10, "edges count from 0 in x, since one is at 0 in x/2.xml"},
      {"10", "-4", {}, 9, "edges count from 1 in x"},  // of a box that is cut off
      {"10", "0", 1, 9, nullptr},
      {"10", "5", 0, 10, nullptr},
  };
  image("i/1.png");
  image("i/2.png");
  for (const auto& one : cases) {
    text("x/1.xml", cat(one.first, "7", "40"));
    text("x/2.xml", cat("3", one.second, "40"));
    SourceSpec spec;
    spec.root = "i";
    spec.labels = LabelSpec{LabelFormat::kVoc, "x", one.edges_from};
    spec.pairs.stills.emplace();
    const auto dataset = open_frames_dataset(spec, folder_.path());
    const double from = 10 - one.left;
    EXPECT_EQ(read(*dataset, "1.xml").boxes.at(0).xyxy, (Rectangle{one.left, 7 - from, 40, 20}));
    EXPECT_EQ(read(*dataset, "2.xml").boxes.at(0).xyxy,
              (Rectangle{3 - from, std::stod(one.second) - from, 40, 20}));
    if (one.note) {
      EXPECT_THAT(dataset->notes(), ElementsAre(HasSubstr(one.note)));
    } else {
      EXPECT_THAT(dataset->notes(), IsEmpty());
    }
  }
}

TEST_F(NamedLabels, WhatVocHasBesideItsFormatIsANote) {
  for (const char* name : {"1", "2", "3"}) image("i/" + std::string(name) + ".png");
  const std::string mark = "<difficult>Unspecified</difficult>";
  text("x/1.xml", cat("5", "5", "9", mark));
  text("x/2.xml", cat("5", "5", "9", mark));
  text("x/3.xml", cat("50", "5", "60", mark + "<truncated>0.25</truncated>"));
  const auto dataset = open(LabelFormat::kVoc, "i", "x");
  EXPECT_THAT(dataset->notes(),
              ElementsAre(HasSubstr("edges count from 1"),
                          "<difficult> that is no 0 or 1 taken for unknown: 3 times, first in "
                          "x/1.xml"));
  EXPECT_THAT(read(*dataset, "3.xml").boxes, IsEmpty());
  EXPECT_THAT(read(*dataset, "3.xml").left_out,
              ElementsAre("expected a box within the image of 40x30, got one from (49, 4) to (60, "
                          "20), in x/3.xml"));
}

TEST_F(NamedLabels, VocMayHaveTracks) {
  for (const char* name : {"1", "2"}) image("i/" + std::string(name) + ".png");
  text("x/1.xml", cat("5", "5", "9", "<trackid>0</trackid>"));
  text("x/2.xml", cat("5", "5", "9", "<trackid>a</trackid>"));
  const auto dataset = open(LabelFormat::kVoc, "i", "x");
  EXPECT_EQ(read(*dataset, "1.xml").boxes.at(0).track_id, 0);
  EXPECT_EQ(read(*dataset, "2.xml").boxes.at(0).track_id, -1);
  EXPECT_THAT(dataset->notes(),
              ::testing::Contains(
                  "<trackid> that is no whole number from 0 left out: 1 time, first in x/2.xml"));
}

TEST_F(NamedLabels, NamesThatNoPlanCanHaveAreLeftOut) {
  image("i/a.png");
  image(
      "i/stra\xdf"
      "e.png");
  text("x/a.xml", cat("5", "5", "9"));
  text(
      "x/stra\xdf"
      "e.xml",
      cat("5", "5", "9"));
  text("x/._a.xml", "Mac OS X");
  const auto dataset = open(LabelFormat::kVoc, "i", "x");
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("x/a.xml"));
  EXPECT_THAT(dataset->notes(),
              ::testing::Contains("1 file left out in i: stra\\xdfe.png (no UTF-8)"));
}

constexpr const char* kInfo =
    "[Sequence]\nname=s\nimDir=img1\nframeRate=25\nseqLength=3\nimWidth=40\nimHeight=30\n"
    "imExt=.png\n";

TEST_F(NamedLabels, MotLiesInTheSequence) {
  for (const char* name : {"1", "2", "3"}) {
    image("m/s/img1/00000" + std::string(name) + ".png");
    image("m/t/img1/00000" + std::string(name) + ".png");
  }
  text("m/s/gt/gt.txt",
       "2,5,1,1,10,10,1,3,1\n2,6,1,1,5,5,0,1,1\n3,5,100,1,5,5,1,1,1\n9,5,1,1,5,5,1\n");
  text("m/s/seqinfo.ini", kInfo);
  const auto dataset = open(LabelFormat::kMot, "m", "m");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("car", "pedestrian"));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("m/s/gt/gt.txt", "m/s/seqinfo.ini"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 sequence without gt/gt.txt or gt.txt in m: t",
                          "no label for 4 of 6 frames in m: no samples of their own"));
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].sample_id, "s/000002");
  EXPECT_EQ(frames[0].sequence, "s");
  EXPECT_EQ(frames[0].frame.path, "m/s/img1/000002.png");
  EXPECT_DOUBLE_EQ(frames[0].frame.time_s, 2 / 25.0);
  EXPECT_EQ(dataset->paired_frame(frames[0], -1).frame.path, "m/s/img1/000001.png");
  EXPECT_EQ(dataset->label_place(frames[0].label_key), "m/s/gt/gt.txt#2");
  const Annotation annotation = read(*dataset, frames[0].label_key);
  ASSERT_EQ(annotation.boxes.size(), 2u);
  EXPECT_EQ(annotation.boxes[0].xyxy, (Rectangle{0, 0, 10, 10}));
  EXPECT_EQ(annotation.boxes[0].track_id, 5);
  EXPECT_EQ(annotation.boxes[1].class_id, 1);
  EXPECT_TRUE(annotation.boxes[1].ignore);
  EXPECT_EQ(annotation.original, "2,5,1,1,10,10,1,3,1\n2,6,1,1,5,5,0,1,1\n");
  const Annotation outside = read(*dataset, frames[1].label_key);
  EXPECT_THAT(outside.boxes, IsEmpty());
  EXPECT_THAT(outside.left_out,
              ElementsAre("expected a box within the image of 40x30, got one from "
                          "(99, 0) to (104, 5), in m/s/gt/gt.txt#3"));
  EXPECT_EQ(frames[2].sample_id, "s/000009");
  EXPECT_EQ(dataset->paired_frame(frames[2], 0).state, PairedFrame::State::kMissing);
  EXPECT_EQ(dataset->paired_frame(frames[2], 0).frame.path, "m/s/img1/000009.png");
}

TEST_F(NamedLabels, MotOfOneSequenceMayBeAFile) {
  image("clip/00000.png");
  image("clip/00001.png");
  text("gt/gt.txt", "1,1,1,1,5,5,1\n");
  auto dataset = open(LabelFormat::kMot, "clip", "gt/gt.txt");
  EXPECT_THAT(dataset->notes(), ElementsAre("frame 1 of gt/gt.txt is clip/00000.png",
                                            HasSubstr("no label for 1 of 2 frames")));
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_EQ(dataset->labelled_frames()[0].sample_id, "00000");
  EXPECT_TRUE(std::isnan(dataset->labelled_frames()[0].frame.time_s));
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key), "gt/gt.txt#1");
  EXPECT_EQ(read(*dataset, "#1").boxes.size(), 1u);
  EXPECT_THAT(read(*dataset, "#2").original, HasSubstr("expected a label, got none"));
  text("seqinfo.ini", kInfo);
  dataset = open(LabelFormat::kMot, "clip", ".");
  EXPECT_EQ(dataset->labelled_frames()[0].label_key, "gt/gt.txt#1");
  EXPECT_EQ(dataset->labelled_frames()[0].frame.time_s, 0);
  EXPECT_DOUBLE_EQ(dataset->paired_frame(dataset->labelled_frames()[0], 1).frame.time_s, 1 / 25.);
  image("two/a/1.png");
  image("two/b/1.png");
  EXPECT_THAT([&] { open(LabelFormat::kMot, "two", "gt/gt.txt"); },
              ThrowsMessage<InputError>(HasSubstr("expected a folder of sequences, since there "
                                                  "are 2, got a file, in gt/gt.txt")));
}

TEST_F(NamedLabels, TheSequencesFileIsAboveGtWhateverThePathIs) {
  for (const char* name : {"1", "2", "3"}) image("s/img1/00000" + std::string(name) + ".png");
  text("s/gt/gt.txt", "2,1,1,1,5,5,1\n");
  text("s/gt/deep/x", "");
  text("s/seqinfo.ini", kInfo);
  const struct {
    const char *manifest, *root, *path, *info;
  } cases[] = {
      {"s/gt", "../img1", "gt.txt", "../seqinfo.ini"},
      {"s/gt", "../img1", ".", "./../seqinfo.ini"},
      {"s/gt/deep", "../../img1", "..", "../../seqinfo.ini"},
      {"s/gt/deep", "../../img1", "../gt.txt", "../../seqinfo.ini"},
      {"s/img1", "", "..", "../seqinfo.ini"},
      {"s", "img1", "gt/gt.txt", "seqinfo.ini"},
      {"", "s/img1", "s", "s/seqinfo.ini"},
  };
  for (const auto& layout : cases) {
    const auto dataset = open(LabelFormat::kMot, layout.root, layout.path, layout.manifest);
    ASSERT_EQ(dataset->labelled_frames().size(), 1u) << layout.path;
    EXPECT_DOUBLE_EQ(dataset->labelled_frames()[0].frame.time_s, 2 / 25.) << layout.path;
    EXPECT_THAT(dataset->annotation_files(), ::testing::Contains(layout.info)) << layout.path;
    EXPECT_TRUE(std::filesystem::exists(folder_ / layout.manifest / layout.info)) << layout.info;
  }
}

TEST_F(NamedLabels, MotOfImagesWithoutNumbersNeedsAllOfThem) {
  for (const char* name : {"a", "b", "d", "e"}) image("m/s/" + std::string(name) + ".png");
  text("m/s/gt.txt", "1,1,1,1,5,5,1\n4,1,1,1,5,5,1\n5,1,1,1,5,5,1\n");
  const auto refused = [&](const char* reason) {
    EXPECT_THAT([&] { open(LabelFormat::kMot, "m", "m"); },
                ThrowsMessage<InputError>(HasSubstr(reason)));
  };
  refused("expected numbered images, or all 5 frames of m/s/gt.txt, got 4 without numbers, in m/s");
  image("m/s/c.png");
  const auto dataset = open(LabelFormat::kMot, "m", "m");
  ASSERT_EQ(dataset->labelled_frames().size(), 3u);
  EXPECT_EQ(dataset->labelled_frames()[1].frame.path, "m/s/d.png");
  // seqinfo.ini counts frames without labels, too.
  text("m/s/seqinfo.ini", "[Sequence]\nframeRate=25\nseqLength=6\nimWidth=40\nimHeight=30\n");
  refused("all 6 frames of m/s/gt.txt, got 5");
  // Numbers from 0 may have gaps.
  for (const char* name : {"00", "01", "04"}) image("n/" + std::string(name) + ".png");
  text("n/gt.txt", "5,1,1,1,5,5,1\n");
  EXPECT_EQ(open(LabelFormat::kMot, "n", "n")->labelled_frames().at(0).frame.path, "n/04.png");
  // As may those that other text follows; the absent frame is called as they are.
  for (const char* name : {"00_rgb", "01_rgb", "03_rgb"}) image("o/" + std::string(name) + ".png");
  text("o/gt.txt", "1,1,1,1,5,5,1\n3,1,1,1,5,5,1\n4,1,1,1,5,5,1\n");
  const auto named = open(LabelFormat::kMot, "o", "o");
  ASSERT_EQ(named->labelled_frames().size(), 3u);
  EXPECT_EQ(named->labelled_frames()[0].frame.path, "o/00_rgb.png");
  EXPECT_EQ(named->labelled_frames()[1].frame.path, "o/02_rgb.png");
  EXPECT_EQ(named->labelled_frames()[1].frame.index, -1);
  EXPECT_EQ(named->labelled_frames()[2].frame.path, "o/03_rgb.png");
  text("n/gone/gt/gt.txt", "1,1,1,1,5,5,1\n");
  EXPECT_THAT(open(LabelFormat::kMot, "n", "n")->notes(),
              ::testing::Contains("1 sequence of labels without images left out in n: gone"));
}

TEST_F(NamedLabels, MotsTablesOfOtherProgramsAreToldOf) {
  for (const char* name : {"s", "t", "u"}) image("m/" + std::string(name) + "/img1/000001.png");
  text("m/s/gt/gt.txt", "1,1,10,5,20,10,1,2,1\n1,-1,1,1,5,5,-1,1,1\n");
  text("m/s/gt/labels.txt",
       "\xEF\xBB\xBF"
       "tram\ndog\n");
  text("m/t.txt", "1,0,10,5,20,10,1,4,0,1\n");
  text("m/u/gt/gt.txt", "1,1,11,6,20,10,1,3,1\n");
  const auto dataset = open(LabelFormat::kMot, "m", "m");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("car", "dog", "tram"));
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("m/s/gt/gt.txt", "m/s/gt/labels.txt", "m/t.txt", "m/u/gt/gt.txt"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 file with the classes of labels.txt, with edges from 0 as CVAT writes "
                          "them (or as \"edges_from\" in the manifest's labels says): "
                          "m/s/gt/gt.txt",
                          "1 file with VisDrone's classes in column 8, with edges from 0 as the "
                          "programs that convert VisDrone take them (or as \"edges_from\" in the "
                          "manifest's labels says): m/t.txt",
                          "conf -1 taken for 1: 1 time, first in m/s/gt/gt.txt#1",
                          "id -1 taken for none: 1 time, first in m/s/gt/gt.txt#1"));
  for (const char* key : {"s/gt/gt.txt#1", "t.txt#1", "u/gt/gt.txt#1"}) {
    const Annotation annotation = read(*dataset, key);
    ASSERT_FALSE(annotation.boxes.empty()) << annotation.original;
    EXPECT_EQ(annotation.boxes[0].xyxy, (Rectangle{10, 5, 30, 15})) << key;
  }
  SourceSpec spec;
  spec.root = "m";
  spec.labels = LabelSpec{LabelFormat::kMot, "m", 1};
  const auto from_1 = open_frames_dataset(spec, folder_.path());
  for (const char* key : {"s/gt/gt.txt#1", "t.txt#1"}) {
    EXPECT_EQ(read(*from_1, key).boxes.at(0).xyxy, (Rectangle{9, 4, 29, 14})) << key;
  }
  EXPECT_THAT(from_1->notes(),
              ::testing::Contains("1 file with VisDrone's classes in column 8: m/t.txt"));
}

TEST_F(NamedLabels, OneFileOfClassesMayServeSeveralMotSequences) {
  for (const char* name : {"s", "t"}) image("m/" + std::string(name) + "/000001.png");
  text("x/s.txt", "1,1,1,1,5,5,1,1,1\n");
  text("x/t.txt", "1,1,2,1,5,5,1,2,1\n");
  text("x/labels.txt", "tram\ndog\n");
  const auto dataset = open(LabelFormat::kMot, "m", "x");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("dog", "tram"));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("x/labels.txt", "x/s.txt", "x/t.txt"));
}

TEST_F(NamedLabels, CopiesOfASequenceAreToldOf) {
  for (const char* name : {"M-02-DPM", "M-02-SDP", "M-04-DPM"}) {
    image("m/" + std::string(name) + "/img1/000001.png");
  }
  text("m/M-02-DPM/gt/gt.txt", "1,1,1,1,5,5,1,1,1\n");
  text("m/M-02-SDP/gt/gt.txt", "1,1,1,1,5,5,1,1,1\n");
  text("m/M-04-DPM/gt/gt.txt", "1,1,2,1,5,5,1,1,1\n");
  const auto dataset = open(LabelFormat::kMot, "m", "m");
  ASSERT_EQ(dataset->notes().size(), 1u);
  EXPECT_THAT(dataset->notes()[0],
              ::testing::StartsWith("1 sequence with the labels of another, as MOT17 has each"));
  EXPECT_THAT(dataset->notes()[0], ::testing::EndsWith("): M-02-SDP (of M-02-DPM)"));
}

TEST_F(NamedLabels, TablesOfOneHashAreNoCopies) {
  const std::string tables[] = {"1,1,1,1,2,2,1,1,Oi37xZjQntugbAdU\n",
                                "1,1,1,1,2,2,1,1,HJQyXapZTV9qbGum\n"};
  ASSERT_EQ(std::hash<std::string>()(tables[0]), std::hash<std::string>()(tables[1]));
  for (const std::size_t i : {0, 1}) {
    image("m/" + std::to_string(i) + "/img1/000001.png");
    text("m/" + std::to_string(i) + "/gt/gt.txt", tables[i]);
  }
  EXPECT_THAT(open(LabelFormat::kMot, "m", "m")->notes(), ::testing::IsEmpty());
}

TEST_F(NamedLabels, MotsLengthAloneIsEnough) {
  for (const char* name : {"1", "2"}) image("m/s/img1/00000" + std::string(name) + ".png");
  text("m/s/gt/gt.txt", "1.0,1.0,1,1,5,5,1\n");
  text("m/s/seqinfo.ini", "[Sequence]\nname=s\nseqLength=2\n");
  const auto dataset = open(LabelFormat::kMot, "m", "m");
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_TRUE(std::isnan(dataset->labelled_frames()[0].frame.time_s));
  EXPECT_EQ(read(*dataset, "s/gt/gt.txt#1").boxes.size(), 1u);
}

TEST_F(NamedLabels, AnAbsentImageIsOfTheSequenceThatItsNameTells) {
  for (const char* name : {"a_1", "a_2", "b_1", "b_2", "c"}) {
    image("i/" + std::string(name) + ".png");
  }
  const std::string box = ",cat,0,1,2,3\n";
  text("t.csv", "image,class,left,top,right,bottom\na_1.png" + box + "a_9.png" + box + "b_7.png" +
                    box + "c.png" + box + "d_1.png" + box);
  std::map<std::string, std::string> sequences;
  const auto dataset = open(LabelFormat::kCsv, "i", "t.csv");
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    sequences[frame.sample_id] = frame.sequence;
  }
  EXPECT_EQ(sequences["a_1"], "a");
  EXPECT_EQ(sequences["a_9"], "a");
  EXPECT_EQ(sequences["b_7"], "b");
  EXPECT_EQ(sequences["c"], "c");
}

TEST_F(NamedLabels, ATableNamesItsImages) {
  image("i/a/1.png");
  image("i/a/2.png");
  image("i/b/3.png");
  image("i/b/2.png");
  const std::string header = "image,class,left,top,right,bottom\n";
  text("t.csv",
       header + "a/1.png,cat,0,1,2,3\n3.png,,,,,\ni/b/2.png,ant,41,1,50,3\ngone.png,x,1,1,2,2\n");
  const auto dataset = open(LabelFormat::kCsv, "i", "t.csv");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("ant", "cat", "x"));
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 4u);
  EXPECT_EQ(frames[0].sample_id, "a/1");
  EXPECT_EQ(read(*dataset, frames[0].label_key).boxes.at(0).xyxy, (Rectangle{0, 1, 2, 3}));
  EXPECT_EQ(read(*dataset, frames[0].label_key).boxes.at(0).class_id, 1);
  EXPECT_EQ(read(*dataset, frames[0].label_key).original, "a/1.png,cat,0,1,2,3\n");
  EXPECT_EQ(frames[1].sample_id, "b/2");
  EXPECT_THAT(read(*dataset, frames[1].label_key).left_out,
              ElementsAre("expected a box within the image of 40x30, got one from (41, 1) to "
                          "(50, 3), in t.csv#i/b/2.png"));
  EXPECT_EQ(frames[2].sample_id, "b/3");
  EXPECT_THAT(read(*dataset, frames[2].label_key).boxes, IsEmpty());
  EXPECT_EQ(frames[3].sample_id, "gone");
  text("t.csv", header + "2.png,cat,0,1,2,3\n");
  EXPECT_THAT([&] { open(LabelFormat::kCsv, "i", "t.csv"); },
              ThrowsMessage<InputError>(HasSubstr("got 1 bare name")));
  // Right in the root, and not the image of that name in a folder of it.
  text("t.csv", header + "i/1.png,cat,0,1,2,3\n");
  const auto absent = open(LabelFormat::kCsv, "i", "t.csv");
  ASSERT_EQ(absent->labelled_frames().size(), 1u);
  EXPECT_EQ(absent->paired_frame(absent->labelled_frames()[0], 0).frame.path, "i/1.png");
}

TEST_F(NamedLabels, NumbersThatMayCountFrom1AreWarnedOf) {
  for (const char* name : {"000000", "000001", "000002"}) {
    image("i/" + std::string(name) + ".png");
  }
  const std::string header = "image,class,left,top,right,bottom\n", box = ",cat,0,1,2,3\n";
  text("t.csv", header + "1" + box + "2" + box + "3" + box);
  EXPECT_THAT(
      open(LabelFormat::kCsv, "i", "t.csv")->warnings(),
      ElementsAre("images are named by their numbers in t.csv (1 for 000001.png), and 000000.png "
                  "has no label: if the file counts from 1, all labels are one image late; name "
                  "the images by their file names then"));
  text("t.csv", header + "0" + box + "2" + box);
  EXPECT_THAT(open(LabelFormat::kCsv, "i", "t.csv")->warnings(), IsEmpty());
  text("t.csv", header + "000001.png" + box);
  EXPECT_THAT(open(LabelFormat::kCsv, "i", "t.csv")->warnings(), IsEmpty());
}

TEST_F(NamedLabels, OfVideosTheFrameNumberStandsForTheImage) {
  text("v/other.json", R"({"1": "beside the video"})");
  testing::write_counting_video(folder_ / "v/clip.avi", 6);
  testing::write_counting_video(folder_ / "v/other.avi", 3);
  text("v/boxes.csv",
       "image,class,left,top,right,bottom\nclip/2,cat,0,1,2,3\n"
       "clip/000004.png,dog,0,1,64,48\nother/1,cat,64,0,70,9\nclip/6,cat,1,1,2,2\n");
  auto dataset = open(LabelFormat::kCsv, "v", "v/boxes.csv");
  const auto* frames = &dataset->labelled_frames();
  ASSERT_EQ(frames->size(), 4u);
  EXPECT_EQ((*frames)[0].sample_id, "clip/000002");
  EXPECT_EQ((*frames)[0].frame.video_frame, 2);
  EXPECT_DOUBLE_EQ((*frames)[0].frame.time_s, 2 / 25.0);
  EXPECT_EQ((*frames)[0].label_key, "clip/2");
  EXPECT_EQ(dataset->paired_frame((*frames)[0], -1).state, PairedFrame::State::kPresent);
  EXPECT_EQ(read(*dataset, "clip/2").boxes.at(0).xyxy, (Rectangle{0, 1, 2, 3}));
  EXPECT_EQ((*frames)[1].sample_id, "clip/000004");
  EXPECT_EQ(read(*dataset, (*frames)[1].label_key).boxes.at(0).class_id, 1);
  EXPECT_EQ((*frames)[2].sample_id, "clip/6") << "the video has no such frame";
  EXPECT_EQ(dataset->paired_frame((*frames)[2], 0).state, PairedFrame::State::kMissing);
  EXPECT_THAT(read(*dataset, (*frames)[3].label_key).left_out,
              ElementsAre(HasSubstr("expected a box within the image of 64x48")));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 entry left out in v: other.json",
                          HasSubstr("no label for 6 of 9 frames in v/boxes.csv")));

  text("v/labels/classes.txt", "cat");
  text("v/labels/clip_000003.txt", "0 0.5 0.5 1 1");
  text("v/labels/other/1.txt", "0 0.5 0.5 0.5 0.5");
  dataset = open(LabelFormat::kYolo, "v", "v/labels");
  frames = &dataset->labelled_frames();
  ASSERT_EQ(frames->size(), 2u);
  EXPECT_EQ((*frames)[0].sample_id, "clip/000003");
  EXPECT_EQ(read(*dataset, (*frames)[0].label_key).boxes.at(0).xyxy, (Rectangle{0, 0, 64, 48}));
  EXPECT_EQ((*frames)[1].sample_id, "other/000001");

  text("gt.txt", "1,1,1,1,5,5,1\n");
  dataset = open(LabelFormat::kMot, "v/clip.avi", "gt.txt");
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_EQ(dataset->labelled_frames()[0].sample_id, "clip/000000") << "MOT counts from 1";

  text("coco.json",
       R"({"images": [{"id": 1, "file_name": "clip/000005.jpg", "width": 64, "height": 48}],
           "annotations": [], "categories": []})");
  dataset = open(LabelFormat::kCoco, "v", "coco.json");
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_EQ(dataset->labelled_frames()[0].sample_id, "clip/000005");
  EXPECT_FALSE(is_fault(dataset->annotation("1")));
}

}  // namespace
}  // namespace eventgan
