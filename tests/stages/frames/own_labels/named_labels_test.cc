

#include "stages/frames/sequences/frames_dataset.h"
#include "tests/stages/frames/decoding/test_video.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

/// Images of 40 x 30 and labels in a folder.
class NamedLabels : public FolderTest {
 protected:
  /// As a manifest in that folder would.
  std::unique_ptr<Dataset> open(LabelFormat format, const std::string& root,
                                const std::string& path, const std::string& manifest = "",
                                std::optional<int> edges_from = {}) const {
    SourceSpec spec;
    spec.root = root;
    spec.labels = LabelSpec{format, path, edges_from};
    return open_frames_dataset(spec, at(manifest));
  }
  /// As a manifest beside these folders would.
  std::unique_ptr<Dataset> voc(const std::string& root = "i", const std::string& path = "x") const {
    return open(LabelFormat::kVoc, root, path);
  }
  std::unique_ptr<Dataset> mot(const std::string& root, const std::string& path) const {
    return open(LabelFormat::kMot, root, path);
  }
  /// A table of images in i.
  std::unique_ptr<Dataset> csv(const std::string& rows) const {
    write("t.csv", "image,class,left,top,right,bottom\n" + rows);
    return open(LabelFormat::kCsv, "i", "t.csv");
  }
  static std::string voc_xml(const std::string& name, const std::string& size = "40",
                             const std::string& more = "") {
    return "<annotation><size><width>" + size + "</width><height>30</height></size><object><name>" +
           name +
           "</name><bndbox><xmin>1</xmin><ymin>2</ymin><xmax>3</xmax><ymax>4</ymax></bndbox>" +
           more + "</object></annotation>";
  }
};

std::vector<Rectangle> boxes_of(const Dataset& dataset, const std::string& key) {
  return rectangles(annotation_of(dataset, key));
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
  const std::string xml = voc_xml("cat", "40", "<difficult>1</difficult>");
  for (const auto& [root, path, image, label] : cases) {
    SCOPED_TRACE(label);
    for (const char* folder : {"VOC", "d"}) fs::remove_all(at(folder));
    images({image});
    write(label, xml);
    const auto dataset = voc(root, path);
    ASSERT_EQ(dataset->labelled_frames().size(), 1u);
    EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("cat"));
    EXPECT_THAT(dataset->annotation_files(), ElementsAre(label));
    EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key), label);
    EXPECT_EQ(annotation_of(*dataset),
              (Annotation{xml, {Box{.xyxy = {0, 1, 3, 4}, .ignore = true}}, {}}));
  }
}

TEST_F(NamedLabels, ClassesAreNumberedByName) {
  images({"i/a.png", "i/b.png", "i/c.png", "i/d.png"});
  write("x/a.xml", voc_xml("dog"));
  write("x/b.xml", voc_xml("cat"));
  write("x/c.xml", voc_xml("bird", "41"));
  write("x/d.xml", "<annotation");
  write("x/gone.xml", voc_xml("ant"));
  const auto dataset = voc();
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("bird", "cat", "dog"));
  ASSERT_EQ(dataset->labelled_frames().size(), 5u);
  EXPECT_EQ(annotation_of(*dataset, "a.xml").boxes.at(0).class_id, 2);
  EXPECT_EQ(annotation_of(*dataset, "b.xml").boxes.at(0).class_id, 1);
  EXPECT_EQ(fault_of(*dataset, 2),
            "expected an image of 41x30, as x/c.xml says, got 40x30, in i/c.png");
  EXPECT_THAT(fault_of(*dataset, 3), HasSubstr("expected XML"));
  EXPECT_EQ(dataset->labelled_frames()[4].sample_id, "gone");
  EXPECT_THAT(paired(*dataset, 4, {0}), ElementsAre("missing i/gone.png -1"));
  write("x/a.xml", voc_xml("eel"));
  EXPECT_THAT(fault_of(*dataset), HasSubstr("got \"eel\", in x/a.xml"));
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
  images({"i/1.png", "i/2.png"});
  for (const auto& one : cases) {
    write("x/1.xml", cat(one.first, "7", "40"));
    write("x/2.xml", cat("3", one.second, "40"));
    const auto dataset = open(LabelFormat::kVoc, "i", "x", "", one.edges_from);
    const double from = 10 - one.left;
    EXPECT_THAT(boxes_of(*dataset, "1.xml"), ElementsAre(Rectangle{one.left, 7 - from, 40, 20}));
    EXPECT_THAT(boxes_of(*dataset, "2.xml"),
                ElementsAre(Rectangle{3 - from, std::stod(one.second) - from, 40, 20}));
    Texts notes = dataset->notes();
    std::erase_if(notes, [](const std::string& note) { return !note.starts_with("edges"); });
    EXPECT_EQ(notes.size(), one.note ? 1u : 0u);
    if (one.note) {
      EXPECT_THAT(notes, ElementsAre(HasSubstr(one.note)));
    }
  }
  const std::string roboflow = "<source><database>roboflow.com</database></source>";
  write("x/2.xml", cat("3", "5", "40", roboflow));
  EXPECT_THAT(open(LabelFormat::kVoc, "i", "x")->notes(),
              Contains(StartsWith("edges count from 1 in x, as Pascal VOC's do")));
  write("x/1.xml", cat("10", "7", "40", roboflow));
  EXPECT_THAT(open(LabelFormat::kVoc, "i", "x")->notes(),
              Contains("edges count from 0 in x, as Roboflow's do"));
}

TEST_F(NamedLabels, TheEdgesAt0MayBeLeftOrTop) {
  images({"i/1.png"});
  const struct {
    const char *left, *top;
    double from;
  } cases[] = {{"0", "5", 0}, {"0.5", "5", 0}, {"5", "0", 0}, {"1", "1", 1}};  // VOC's first pixel
  for (const auto& [left, top, from] : cases) {
    write("x/1.xml", cat(left, top, "40"));
    EXPECT_THAT(boxes_of(*voc(), "1.xml"),
                ElementsAre(Rectangle{std::stod(left) - from, std::stod(top) - from, 40, 20}));
  }
}

TEST_F(NamedLabels, WhatVocHasBesideItsFormatIsANote) {
  images({"i/1.png", "i/2.png", "i/3.png"});
  const std::string mark = "<difficult>Unspecified</difficult>";
  write("x/1.xml", cat("5", "5", "9", mark + "<trackid>0</trackid>"));
  write("x/2.xml", cat("5", "5", "9", mark + "<trackid>a</trackid>"));
  write("x/3.xml", cat("50", "5", "60", mark + "<truncated>0.25</truncated>"));
  const auto dataset = voc();
  EXPECT_THAT(dataset->notes(),
              ::testing::UnorderedElementsAre(
                  HasSubstr("edges count from 1"),
                  "<difficult> that is no 0 or 1 taken for unknown: 3 times, first in x/1.xml",
                  "<trackid> that is no whole number from 0 left out: 1 time, first in x/2.xml"));
  EXPECT_EQ(annotation_of(*dataset, "1.xml").boxes.at(0).track_id, 0);
  EXPECT_EQ(annotation_of(*dataset, "2.xml").boxes.at(0).track_id, -1);
  EXPECT_THAT(annotation_of(*dataset, "3.xml").boxes, IsEmpty());
  EXPECT_THAT(annotation_of(*dataset, "3.xml").left_out,
              ElementsAre("expected a box within the image of 40x30, got one from (49, 4) to (60, "
                          "20), in x/3.xml"));
}

TEST_F(NamedLabels, ATrackOfTwoBoxesIsLeftOut) {
  images({"i/1.png"});
  std::string two = cat("5", "5", "9", "<trackid>3</trackid>");
  const std::size_t begin = two.find("<object>"), end = two.find("</annotation>");
  two.insert(end, two.substr(begin, end - begin));
  write("x/1.xml", two);
  const Annotation read = annotation_of(*voc(), "1.xml");
  ASSERT_EQ(read.boxes.size(), 2u);
  EXPECT_EQ(read.boxes[0].track_id, -1);
  EXPECT_EQ(read.boxes[1].track_id, -1);
  EXPECT_THAT(
      read.tracks_left_out,
      ElementsAre("expected each track once in an image, got track 3 of 2 boxes, in x/1.xml"));
}

TEST_F(NamedLabels, NamesThatNoPlanCanHaveAreLeftOut) {
  images({"i/a.png", "i/stra\337e.png"});
  for (const char* name : {"x/a.xml", "x/stra\337e.xml"}) write(name, cat("5", "5", "9"));
  write("x/._a.xml", "Mac OS X");
  EXPECT_THAT(ids_of(*voc()), ElementsAre("a"));
  EXPECT_THAT(voc()->annotation_files(), ElementsAre("x/a.xml"));
  EXPECT_THAT(voc()->notes(), Contains("1 file left out in i: stra\\xdfe.png (no UTF-8)"));
}

constexpr const char* kInfo =
    "[Sequence]\nname=s\nimDir=img1\nframeRate=25\nseqLength=3\nimWidth=40\nimHeight=30\n"
    "imExt=.png\n";

TEST_F(NamedLabels, MotLiesInTheSequence) {
  for (const std::string folder : {"m/s/img1/", "m/t/img1/"}) {
    images({folder + "000001.png", folder + "000002.png", folder + "000003.png"});
  }
  write("m/s/gt/gt.txt",
        "2,5,1,1,10,10,1,3,1\n2,6,1,1,5,5,0,1,1\n3,5,100,1,5,5,1,1,1\n9,5,1,1,5,5,1\n");
  write("m/s/seqinfo.ini", kInfo);
  const auto dataset = mot("m", "m");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("car", "pedestrian"));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("m/s/gt/gt.txt", "m/s/seqinfo.ini"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 sequence without gt/gt.txt or gt.txt in m: t",
                          "no label for 4 of 6 frames in m: no samples of their own"));
  const auto& frames = dataset->labelled_frames();
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(text_of(frames[0]), "s/000002 of s: m/s/img1/000002.png 2 by s/gt/gt.txt#2");
  EXPECT_DOUBLE_EQ(frames[0].frame.time_s, 2 / 25.0);
  EXPECT_THAT(paired(*dataset, 0, {-1}), ElementsAre("present m/s/img1/000001.png 1"));
  EXPECT_EQ(dataset->label_place(frames[0].label_key), "m/s/gt/gt.txt#2");
  const Annotation annotation = annotation_of(*dataset);
  EXPECT_THAT(annotation.boxes,
              ElementsAre(Box{.class_id = 0, .xyxy = {0, 0, 10, 10}, .track_id = 5},
                          Box{.class_id = 1, .xyxy = {0, 0, 5, 5}, .track_id = 6, .ignore = true}));
  EXPECT_EQ(annotation.original, "2,5,1,1,10,10,1,3,1\n2,6,1,1,5,5,0,1,1\n");
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, IsEmpty());
  EXPECT_THAT(annotation_of(*dataset, 1).left_out,
              ElementsAre("expected a box within the image of 40x30, got one from "
                          "(99, 0) to (104, 5), in m/s/gt/gt.txt#3"));
  EXPECT_EQ(frames[2].sample_id, "s/000009");
  EXPECT_THAT(paired(*dataset, 2, {0}), ElementsAre("missing m/s/img1/000009.png -1"));
}

TEST_F(NamedLabels, MotOfOneSequenceMayBeAFile) {
  images({"clip/00000.png", "clip/00001.png", "two/a/1.png", "two/b/1.png"});
  write("gt/gt.txt", "1,1,1,1,5,5,1\n");
  auto dataset = mot("clip", "gt/gt.txt");
  EXPECT_THAT(dataset->notes(), ElementsAre("frame 1 of gt/gt.txt is clip/00000.png",
                                            HasSubstr("no label for 1 of 2 frames")));
  EXPECT_THAT(ids_of(*dataset), ElementsAre("00000"));
  EXPECT_TRUE(std::isnan(dataset->labelled_frames()[0].frame.time_s));
  EXPECT_EQ(dataset->label_place(dataset->labelled_frames()[0].label_key), "gt/gt.txt#1");
  EXPECT_EQ(annotation_of(*dataset, "#1").boxes.size(), 1u);
  EXPECT_THAT(fault_of(dataset->annotation("#2")), HasSubstr("expected a label, got none"));
  write("seqinfo.ini", kInfo);
  dataset = mot("clip", ".");
  EXPECT_EQ(dataset->labelled_frames()[0].label_key, "gt/gt.txt#1");
  EXPECT_EQ(dataset->labelled_frames()[0].frame.time_s, 0);
  EXPECT_DOUBLE_EQ(dataset->paired_frame(dataset->labelled_frames()[0], 1).frame.time_s, 1 / 25.);
  EXPECT_THROWS(mot("two", "gt/gt.txt"), InputError,
                "expected a folder of sequences, since there are 2, got a file, in gt/gt.txt");
}

TEST_F(NamedLabels, TheSequencesFileIsAboveGtWhateverThePathIs) {
  images({"s/img1/000001.png", "s/img1/000002.png", "s/img1/000003.png"});
  write("s/gt/gt.txt", "2,1,1,1,5,5,1\n");
  write("s/gt/deep/x");
  write("s/seqinfo.ini", kInfo);
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
  for (const auto& [manifest, root, path, info] : cases) {
    SCOPED_TRACE(path);
    const auto dataset = open(LabelFormat::kMot, root, path, manifest);
    ASSERT_EQ(dataset->labelled_frames().size(), 1u);
    EXPECT_DOUBLE_EQ(dataset->labelled_frames()[0].frame.time_s, 2 / 25.);
    EXPECT_THAT(dataset->annotation_files(), Contains(info));
    EXPECT_TRUE(fs::exists(at(manifest) / info));
  }
}

TEST_F(NamedLabels, MotOfImagesWithoutNumbersNeedsAllOfThem) {
  images({"m/s/a.png", "m/s/b.png", "m/s/d.png", "m/s/e.png"});
  write("m/s/gt.txt", "1,1,1,1,5,5,1\n4,1,1,1,5,5,1\n5,1,1,1,5,5,1\n");
  EXPECT_THROWS(mot("m", "m"), InputError,
                "expected numbered images, or all 5 frames of m/s/gt.txt, got 4 without numbers, "
                "in m/s");
  images({"m/s/c.png"});
  EXPECT_THAT(ids_of(*mot("m", "m")), ElementsAre("s/a", "s/d", "s/e"));
  // seqinfo.ini counts frames without labels, too.
  write("m/s/seqinfo.ini", "[Sequence]\nframeRate=25\nseqLength=6\nimWidth=40\nimHeight=30\n");
  EXPECT_THROWS(mot("m", "m"), InputError, "all 6 frames of m/s/gt.txt, got 5");
  write("m/s/seqinfo.ini", "[Sequence]\nframeRate=25\nseqLength=4\nimWidth=40\nimHeight=30\n");
  EXPECT_THROWS(mot("m", "m"), InputError, "all 4 frames of m/s/gt.txt, got 5");
  // Numbers from 0 may have gaps.
  images({"n/00.png", "n/01.png", "n/04.png"});
  write("n/gt.txt", "5,1,1,1,5,5,1\n");
  EXPECT_THAT(paired(*mot("n", "n"), 0, {0}), ElementsAre("present n/04.png 4"));
  // As may those that other text follows; the absent frame is called as they are.
  images({"o/00_rgb.png", "o/01_rgb.png", "o/03_rgb.png"});
  write("o/gt.txt", "1,1,1,1,5,5,1\n3,1,1,1,5,5,1\n4,1,1,1,5,5,1\n");
  const char* frames[] = {"present o/00_rgb.png 0", "missing o/02_rgb.png -1",
                          "present o/03_rgb.png 3"};
  for (const std::size_t i : {0, 1, 2}) {
    EXPECT_THAT(paired(*mot("o", "o"), i, {0}), ElementsAre(frames[i]));
  }
  write("n/gone/gt/gt.txt", "1,1,1,1,5,5,1\n");
  EXPECT_THAT(mot("n", "n")->notes(),
              Contains("1 sequence of labels without images left out in n: gone"));
}

TEST_F(NamedLabels, MotsTablesOfOtherProgramsAreToldOf) {
  images({"m/s/img1/000001.png", "m/t/img1/000001.png", "m/u/img1/000001.png"});
  write("m/s/gt/gt.txt", "1,1,10,5,20,10,1,2,1\n1,-1,1,1,5,5,-1,1,1\n");
  write("m/s/gt/labels.txt", "\357\273\277tram\ndog\n");
  write("m/t.txt", "1,0,10,5,20,10,1,4,0,1\n");
  write("m/u/gt/gt.txt", "1,1,11,6,20,10,1,3,1\n");
  const auto dataset = mot("m", "m");
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
    EXPECT_EQ(boxes_of(*dataset, key).at(0), (Rectangle{10, 5, 30, 15})) << key;
  }
  const auto from_1 = open(LabelFormat::kMot, "m", "m", "", 1);
  for (const char* key : {"s/gt/gt.txt#1", "t.txt#1"}) {
    EXPECT_EQ(boxes_of(*from_1, key).at(0), (Rectangle{9, 4, 29, 14})) << key;
  }
  EXPECT_THAT(from_1->notes(), Contains("1 file with VisDrone's classes in column 8: m/t.txt"));
}

TEST_F(NamedLabels, OneFileOfClassesMayServeSeveralMotSequences) {
  images({"m/s/000001.png", "m/t/000001.png"});
  write("x/s.txt", "1,1,1,1,5,5,1,1,1\n");
  write("x/t.txt", "1,1,2,1,5,5,1,2,1\n");
  write("x/labels.txt", "tram\ndog\n");
  EXPECT_THAT(mot("m", "x")->label_schema().class_names, ElementsAre("dog", "tram"));
  EXPECT_THAT(mot("m", "x")->annotation_files(), ElementsAre("x/labels.txt", "x/s.txt", "x/t.txt"));
}

TEST_F(NamedLabels, CopiesOfASequenceAreToldOf) {
  for (const auto& [name, left] :
       {std::pair("M-02-DPM"s, "1"), {"M-02-SDP", "1"}, {"M-04-DPM", "2"}}) {
    images({"m/" + name + "/img1/000001.png"});
    write("m/" + name + "/gt/gt.txt", "1,1,"s + left + ",1,5,5,1,1,1\n");
  }
  EXPECT_THAT(
      mot("m", "m")->notes(),
      ElementsAre(AllOf(StartsWith("1 sequence with the labels of another, as MOT17 has each"),
                        EndsWith("): M-02-SDP (of M-02-DPM)"))));
}

TEST_F(NamedLabels, TablesOfOneHashAreNoCopies) {
  const std::string first = "1,1,1,1,2,2,1,1,Oi37xZjQntugbAdU\n";
  const std::string second = "1,1,1,1,2,2,1,1,HJQyXapZTV9qbGum\n";
  ASSERT_EQ(std::hash<std::string>()(first), std::hash<std::string>()(second));
  images({"m/0/img1/000001.png", "m/1/img1/000001.png"});
  write("m/0/gt/gt.txt", first);
  write("m/1/gt/gt.txt", second);
  EXPECT_THAT(mot("m", "m")->notes(), IsEmpty());
}

TEST_F(NamedLabels, MotsLengthAloneIsEnough) {
  images({"m/s/img1/000001.png", "m/s/img1/000002.png"});
  write("m/s/gt/gt.txt", "1.0,1.0,1,1,5,5,1\n");
  write("m/s/seqinfo.ini", "[Sequence]\nname=s\nseqLength=2\n");
  const auto dataset = mot("m", "m");
  ASSERT_EQ(dataset->labelled_frames().size(), 1u);
  EXPECT_TRUE(std::isnan(dataset->labelled_frames()[0].frame.time_s));
  EXPECT_EQ(annotation_of(*dataset, "s/gt/gt.txt#1").boxes.size(), 1u);
}

TEST_F(NamedLabels, AnAbsentImageIsOfTheSequenceThatItsNameTells) {
  images({"i/a_1.png", "i/a_2.png", "i/b_1.png", "i/b_2.png", "i/c.png"});
  std::string rows;
  for (const char* name : {"a_1", "a_9", "b_7", "c", "d_1"}) rows += name + ".png,cat,0,1,2,3\n"s;
  std::map<std::string, std::string> sequences;
  const auto dataset = csv(rows);
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    sequences[frame.sample_id] = frame.sequence;
  }
  EXPECT_EQ(sequences["a_1"], "a");
  EXPECT_EQ(sequences["a_9"], "a");
  EXPECT_EQ(sequences["b_7"], "b");
  EXPECT_EQ(sequences["c"], "c");
}

TEST_F(NamedLabels, ATableNamesItsImages) {
  images({"i/a/1.png", "i/a/2.png", "i/b/3.png", "i/b/2.png"});
  const auto dataset =
      csv("a/1.png,cat,0,1,2,3\n3.png,,,,,\ni/b/2.png,ant,41,1,50,3\ngone.png,x,1,1,2,2\n");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("ant", "cat", "x"));
  ASSERT_THAT(ids_of(*dataset), ElementsAre("a/1", "b/2", "b/3", "gone"));
  EXPECT_EQ(annotation_of(*dataset),
            (Annotation{"a/1.png,cat,0,1,2,3\n", {Box{.class_id = 1, .xyxy = {0, 1, 2, 3}}}, {}}));
  EXPECT_THAT(annotation_of(*dataset, 1).left_out,
              ElementsAre("expected a box within the image of 40x30, got one from (41, 1) to "
                          "(50, 3), in t.csv#i/b/2.png"));
  EXPECT_THAT(annotation_of(*dataset, 2).boxes, IsEmpty());
  EXPECT_THROWS(csv("2.png,cat,0,1,2,3\n"), InputError, "got 1 bare name");
  // Right in the root, and not the image of that name in a folder of it.
  const auto absent = csv("i/1.png,cat,0,1,2,3\n");
  ASSERT_EQ(absent->labelled_frames().size(), 1u);
  EXPECT_THAT(paired(*absent, 0, {0}), ElementsAre("missing i/1.png -1"));
}

TEST_F(NamedLabels, NumbersThatMayCountFrom1AreWarnedOf) {
  images({"i/000000.png", "i/000001.png", "i/000002.png"});
  const std::string box = ",cat,0,1,2,3\n";
  EXPECT_THAT(
      csv("1" + box + "2" + box + "3" + box)->warnings(),
      ElementsAre("images are named by their numbers in t.csv (1 for 000001.png), and 000000.png "
                  "has no label: if the file counts from 1, all labels are one image late; name "
                  "the images by their file names then"));
  EXPECT_THAT(csv("0" + box + "2" + box)->warnings(), IsEmpty());
  EXPECT_THAT(csv("000001.png" + box)->warnings(), IsEmpty());
}

TEST_F(NamedLabels, AnotherVideosFrameIsNotTakenForOne) {
  for (const char* folder : {"a", "b", "clips", "videos"}) {
    fs::create_directory(at(folder));
    testing::write_counting_video(at(folder) / "walk.avi", 4);
  }
  const auto open_table = [&](const std::string& root, const Texts& names) {
    std::string table = "image,class,left,top,right,bottom\n";
    for (const std::string& name : names) table += name + ",cat,0,1,2,3\n";
    write("t.csv", table);
    return open(LabelFormat::kCsv, root, "t.csv");
  };
  const struct {
    const char *root, *name;
    bool is_taken;
  } cases[] = {
      {"a", "a/walk/2", true},
      {"b", "a/walk/2", false},
      {"b", "a/walk_000002.png", false},
      {"b", "walk/walk_000002.png", true},
      {"b", "walk/frame_000002.png", true},
      {"clips", "videos/walk/2", false},  // another one that is there
      {"clips", "media/walk/2", true},
      {"clips", "images/frame_000002.png", true},
      {"videos", "home/me/walk.avi/2", true},
  };
  for (const auto& [root, name, is_taken] : cases) {
    const std::int64_t taken = open_table(root, {name})->labelled_frames().at(0).frame.index;
    EXPECT_EQ(taken, is_taken ? 2 : -1) << root << ' ' << name;
  }
  EXPECT_THROWS(
      open_table("videos", {"x/walk/1", "y/walk/2"}), InputError,
      "expected images' paths below videos, got 2 folders that it has not: x, y, in t.csv");
}

TEST_F(NamedLabels, OfSeveralVideosAFolderNamesOne) {
  fs::create_directory(at("videos"));
  testing::write_counting_video(at("videos/frame.avi"), 4);
  testing::write_counting_video(at("videos/walk.avi"), 8);
  for (const auto& [name, id] : {std::pair("walk/frame_000003.png", "walk/000003"),
                                 std::pair("videos/walk/frame_000003.jpg", "walk/000003"),
                                 std::pair("videos/frame/3", "frame/000003"),
                                 std::pair("frame_000003.png", "frame/000003")}) {
    write("t.csv", "image,class,left,top,right,bottom\n"s + name + ",cat,0,1,2,3\n");
    EXPECT_THAT(ids_of(*open(LabelFormat::kCsv, "videos", "t.csv")), ElementsAre(id)) << name;
  }
}

TEST_F(NamedLabels, ImagesThatLabelsNameMayLieInAFolderCalledAsOneOfLabels) {
  write("faces/masks/1.png");
  write("faces/no_masks/1.png");
  write("t.csv",
        "image,class,left,top,right,bottom\nmasks/1.png,cat,0,1,2,3\nno_masks/1.png,cat,0,1,2,3\n");
  const auto dataset = open(LabelFormat::kCsv, "faces", "t.csv");
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    EXPECT_NE(frame.frame.index, -1) << frame.sample_id;
  }
}

TEST_F(NamedLabels, AVideosNumbersThatMayCountFrom1AreWarnedOf) {
  fs::create_directory(at("v"));
  testing::write_counting_video(at("v/walk.avi"), 3);
  const auto warning = [](const std::string& path) {
    return "frames of walk are named by the numbers 1 to 3 in " + path +
           ", and walk/0 has no label: if these count from 1, all labels are one frame late; count "
           "from 0 then";
  };
  const std::pair<Texts, bool> cases[] = {
      {{"walk/1", "walk/2", "walk/3"}, true}, {{"1", "2", "3"}, true},
      {{"walk_1.png", "walk_3.png"}, true},   {{"walk/0", "walk/3"}, false},
      {{"walk/1", "walk/2"}, false},          {{"walk/1", "walk/4"}, false}};
  for (const auto& [names, is_warned] : cases) {
    std::string table = "image,class,left,top,right,bottom\n";
    for (const std::string& name : names) table += name + ",cat,0,1,2,3\n";
    write("t.csv", table);
    EXPECT_EQ(open(LabelFormat::kCsv, "v", "t.csv")->warnings(),
              is_warned ? Texts{warning("t.csv")} : Texts())
        << names.back();
  }
  for (const char* name : {"walk_1", "walk_2", "walk_3"}) {  // as Ultralytics' save_txt
    write("v/labels/"s + name + ".txt", "0 0.5 0.5 1 1");
  }
  EXPECT_THAT(open(LabelFormat::kYolo, "v", "v/labels")->warnings(),
              ElementsAre(warning("v/labels")));
}

TEST_F(NamedLabels, TextsOfTheOnlyVideoMayBeCalledByTheirNumbers) {
  fs::create_directory(at("v"));
  testing::write_counting_video(at("v/clip.avi"), 6);
  write("v/classes.txt", "cat");
  for (const char* name :
       {"labels/frame_000003", "labels/000003", "labels/3", "labels/Frame-3", "labels/frame_no_3",
        "labels/clip/frame_000003", "labels/train/frame_000003", "obj_train_data/frame_000003"}) {
    write("v/"s + name + ".txt", "0 0.5 0.5 1 1");
    const auto dataset = open(LabelFormat::kYolo, "v", "v");
    EXPECT_THAT(ids_of(*dataset), ElementsAre("clip/000003")) << name;
    EXPECT_EQ(dataset->labelled_frames().at(0).frame.index, 3) << name;
    fs::remove_all(at("v") / fs::path(name).begin()->string());
  }
  write("v/labels/frame_000009.txt", "0 0.5 0.5 1 1");
  EXPECT_THAT(paired(*open(LabelFormat::kYolo, "v", "v"), 0, {0}),
              ElementsAre("missing v/clip/000009 -1"));
  write("v/labels/frame_000003.txt", "0 0.5 0.5 1 1");
  testing::write_counting_video(at("v/other.avi"), 2);
  const auto dataset = open(LabelFormat::kYolo, "v", "v");
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    EXPECT_EQ(frame.frame.index, -1) << frame.sample_id << ": it may be either's";
  }
}

TEST_F(NamedLabels, OfVideosTheFrameNumberStandsForTheImage) {
  write("v/other.json", R"({"1": "beside the video"})");
  testing::write_counting_video(at("v/clip.avi"), 6);
  testing::write_counting_video(at("v/other.avi"), 3);
  write("v/boxes.csv",
        "image,class,left,top,right,bottom\nclip/2,cat,0,1,2,3\n"
        "clip/000004.png,dog,0,1,64,48\nother/1,cat,64,0,70,9\nclip/6,cat,1,1,2,2\n");
  auto dataset = open(LabelFormat::kCsv, "v", "v/boxes.csv");
  // The video has no frame 6.
  ASSERT_THAT(ids_of(*dataset),
              ElementsAre("clip/000002", "clip/000004", "clip/6", "other/000001"));
  const LabelledFrame& second = dataset->labelled_frames()[0];
  EXPECT_EQ(second.frame.video_frame, 2);
  EXPECT_DOUBLE_EQ(second.frame.time_s, 2 / 25.0);
  EXPECT_EQ(second.label_key, "clip/2");
  EXPECT_THAT(paired(*dataset, 0, {-1}), ElementsAre("present v/clip.avi 1"));
  EXPECT_THAT(boxes_of(*dataset, "clip/2"), ElementsAre(Rectangle{0, 1, 2, 3}));
  EXPECT_EQ(annotation_of(*dataset, 1).boxes.at(0).class_id, 1);
  EXPECT_THAT(paired(*dataset, 2, {0}), ElementsAre(StartsWith("missing")));
  EXPECT_THAT(annotation_of(*dataset, 3).left_out,
              ElementsAre(HasSubstr("expected a box within the image of 64x48")));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 entry left out in v: other.json",
                          HasSubstr("no label for 6 of 9 frames in v/boxes.csv")));

  write("v/labels/classes.txt", "cat");
  write("v/labels/clip_000003.txt", "0 0.5 0.5 1 1");
  write("v/labels/other/1.txt", "0 0.5 0.5 0.5 0.5");
  dataset = open(LabelFormat::kYolo, "v", "v/labels");
  EXPECT_THAT(ids_of(*dataset), ElementsAre("clip/000003", "other/000001"));
  EXPECT_THAT(rectangles(annotation_of(*dataset)), ElementsAre(Rectangle{0, 0, 64, 48}));

  write("gt.txt", "1,1,1,1,5,5,1\n");
  EXPECT_THAT(ids_of(*mot("v/clip.avi", "gt.txt")), ElementsAre("clip/000000"))
      << "MOT counts from 1";
  write("coco.json",
        R"({"images": [{"id": 1, "file_name": "clip/000005.jpg", "width": 64, "height": 48}],
           "annotations": [], "categories": []})");
  dataset = open(LabelFormat::kCoco, "v", "coco.json");
  EXPECT_THAT(ids_of(*dataset), ElementsAre("clip/000005"));
  EXPECT_EQ(fault_of(*dataset), "no fault");
}

}  // namespace
}  // namespace eventgan
