// Index masks as labels, and those of Pascal VOC beside its own.

#include "manifests/files/sha256.h"
#include "manifests/values/outlines.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "stages/frames/sources/find_source.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

using testing::IndexPng;

constexpr ImageSize kMaskedImage{3, 5};

class MaskLabels : public FolderTest {
 protected:
  void mask(const std::string& name, const std::vector<int>& pixels,
            IndexPng kind = IndexPng::kGrey8) const {
    testing::write_index_image(at(name), kMaskedImage, pixels, kind);
  }
  void add(const std::string& image, const std::string& name, const std::vector<int>& pixels,
           IndexPng kind = IndexPng::kGrey8) const {
    images({image}, kMaskedImage);
    if (!name.empty()) mask(name, pixels, kind);
  }
  std::unique_ptr<Dataset> open(const std::string& root, const std::string& path,
                                LabelFormat format = LabelFormat::kMasks) const {
    SourceSpec spec;
    spec.root = root;
    spec.labels = LabelSpec{format, path};
    return open_frames_dataset(spec, folder_.path());
  }

  const std::vector<int> two_{0, 3, 3, 0, 0,  //
                              0, 3, 0, 0, 8,  //
                              0, 0, 0, 8, 8};
};

TEST_F(MaskLabels, AreABoxAnObject) {
  add("images/FudanPed00001.png", "masks/FudanPed00001.png", two_);
  add("images/FudanPed00002.png", "", {});
  const auto dataset = open("images", "masks");
  EXPECT_THAT(dataset->label_schema().class_names, ElementsAre("object"));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("masks/FudanPed00001.png"));
  EXPECT_THAT(dataset->labelled_frames(), SizeIs(1));
  EXPECT_THAT(dataset->notes(), ElementsAre(HasSubstr("no label for 1 of 2 frames in masks")));
  const Annotation read = annotation_of(*dataset);
  EXPECT_EQ(read.original, R"({"mask":"FudanPed00001.png","objects":[3,8],"sha256":")" +
                               sha256_of_file(at("masks/FudanPed00001.png")) + "\"}");
  ASSERT_THAT(read.boxes, SizeIs(2));
  EXPECT_EQ(read.boxes[0].xyxy, (Rectangle{1, 0, 3, 2}));
  EXPECT_EQ(read.boxes[1].xyxy, (Rectangle{3, 1, 5, 3}));
  for (const Box& box : read.boxes) {
    EXPECT_EQ(box.class_id, 0);
    EXPECT_EQ(box.track_id, -1) << "one image has nothing to do with the next";
    EXPECT_FALSE(box.ignore);
  }
  const GreyImage mask = mask_of(read.boxes[1].outline, kMaskedImage);
  for (std::size_t i = 0; i < two_.size(); ++i) EXPECT_EQ(mask.pixels[i] != 0, two_[i] == 8) << i;
}

TEST_F(MaskLabels, OfDavisNumbersAreTracks) {
  add("JPEGImages/480p/bear/00000.png", "Annotations/480p/bear/00000.png", two_,
      IndexPng::kPalette);
  add("JPEGImages/480p/bear/00001.png", "Annotations/480p/bear/00001.png", std::vector<int>(15),
      IndexPng::kPalette);
  const auto dataset = open("JPEGImages", "Annotations");
  ASSERT_THAT(dataset->labelled_frames(), SizeIs(2));
  const Annotation read = annotation_of(*dataset);
  EXPECT_THAT(read.boxes, ElementsAre(Field(&Box::track_id, 3), Field(&Box::track_id, 8)));
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, IsEmpty());
}

TEST_F(MaskLabels, OfMotsHaveClasses) {
  const std::string file = "instances/0000/000000.png";
  add("image_02/0000/000000.png", file,
      {0, 1005, 1005, 0, 0, 0, 2001, 0, 0, 10000, 0, 0, 0, 10000, 10000}, IndexPng::kGrey16);
  const auto dataset = open("image_02", "instances");
  EXPECT_THAT(dataset->label_schema().class_names,
              ElementsAre("car", "pedestrian", "ignore_region"));
  EXPECT_EQ(dataset->label_meanings().at("masks"), "1000 class + instance");
  const std::vector<Box> boxes = annotation_of(*dataset).boxes;
  ASSERT_THAT(boxes, SizeIs(3));
  EXPECT_EQ(boxes[0].xyxy, (Rectangle{1, 0, 3, 1}));
  const std::tuple<int, int, bool> expected[] = {{0, 1005, false}, {1, 2001, false}, {2, -1, true}};
  for (const std::size_t i : {0, 1, 2}) {
    EXPECT_EQ(std::tuple(boxes[i].class_id, boxes[i].track_id, boxes[i].ignore), expected[i]) << i;
  }
  for (const int other : {7, 999, 3000, 9999, 10001}) {
    mask(file, {0, 1005, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, other}, IndexPng::kGrey16);
    EXPECT_EQ(fault_of(*dataset), "expected MOTS' numbers, 1000 to 2999 and 10000, got " +
                                      std::to_string(other) + ", in " + file);
  }
}

TEST_F(MaskLabels, AreMotsByTheFirstMaskWithObjects) {
  for (int i = 10; i < 40; ++i) {
    const std::string name = "/0/" + std::to_string(i) + ".png";
    add("image_02" + name, "instances" + name, std::vector<int>(15), IndexPng::kGrey16);
  }
  std::vector<int> pixels(15);
  pixels[4] = 10000;
  mask("instances/0/39.png", pixels, IndexPng::kGrey16);
  const auto mots = open("image_02", "instances");
  EXPECT_THAT(mots->notes(), ElementsAre("masks read as MOTS': 1000 class + instance, 10000 is "
                                         "ignored"));
  EXPECT_TRUE(annotation_of(*mots, 29).boxes.at(0).ignore);
  pixels[4] = 65535;  // of no class of theirs
  mask("instances/0/10.png", pixels, IndexPng::kGrey16);
  EXPECT_EQ(fault_of(*open("image_02", "instances")),
            "expected numbers below 1000, since the first mask's are not MOTS' (1000 class + "
            "instance), got 65535, in instances/0/10.png");
}

TEST_F(MaskLabels, OfAnotherSizeAreAFault) {
  add("images/1.png", "masks/1.png", two_);
  testing::write_index_image(at("masks/1.png"), {2, 2}, {0, 1, 1, 1});
  EXPECT_EQ(fault_of(*open("images", "masks")),
            "expected an image of 2x2, as masks/1.png says, got 5x3, in images/1.png");
}

class VocMasks : public MaskLabels {
 protected:
  VocMasks() {
    std::string objects;
    for (const char* box : {"<xmin>1</xmin><ymin>1</ymin><xmax>3</xmax><ymax>2</ymax>",
                            "<xmin>4</xmin><ymin>1</ymin><xmax>5</xmax><ymax>3</ymax>"}) {
      objects += "<object><name>cat</name><bndbox>"s + box + "</bndbox></object>";
    }
    for (const std::string name : {"1", "2"}) {
      images({"VOC/JPEGImages/" + name + ".png"}, kMaskedImage);
      write("VOC/Annotations/" + name + ".xml", "<annotation>" + objects + "</annotation>");
    }
  }
  void write_mask(const std::vector<int>& pixels) const {
    mask("VOC/SegmentationObject/1.png", pixels, IndexPng::kPalette);
  }
};

TEST_F(VocMasks, AreFoundBesideTheAnnotations) {
  write_mask({0, 1, 255, 255, 2, 0, 1, 255, 2, 2, 0, 0, 0, 0, 2});
  for (const char* path : {"VOC/Annotations", "VOC"}) {
    const auto dataset = open("VOC/JPEGImages", path, LabelFormat::kVoc);
    EXPECT_THAT(dataset->annotation_files(),
                ElementsAre("VOC/Annotations/1.xml", "VOC/Annotations/2.xml",
                            "VOC/SegmentationObject/1.png"));
    const Annotation read = annotation_of(*dataset);
    EXPECT_EQ(bounds(read.boxes.at(0).outline), (Rectangle{1, 0, 2, 2}));
    EXPECT_EQ(bounds(read.boxes.at(1).outline), (Rectangle{3, 0, 5, 3}));
    EXPECT_EQ(read.boxes[0].xyxy, (Rectangle{0, 0, 3, 2}));
    EXPECT_TRUE(annotation_of(*dataset, 1).boxes.at(0).outline.empty());
  }
}

TEST_F(VocMasks, WithANumberOfNoObjectAreAFault) {
  write_mask({0, 1, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(fault_of(*open("VOC/JPEGImages", "VOC", LabelFormat::kVoc)),
            "expected numbers of the 2 boxes in VOC/Annotations/1.xml, got 3, in "
            "VOC/SegmentationObject/1.png");
}

TEST_F(MaskLabels, AreFoundBesideVideos) {
  const auto find = [&](const char* folder) { return find_sources(at(folder)).front(); };
  write("j/videos/walk.mp4");
  mask("j/masks/walk/000000.png", two_);
  FoundSource found = find("j");
  ASSERT_TRUE(found.labels);
  EXPECT_EQ(found.labels->format, LabelFormat::kMasks);
  EXPECT_EQ(found.labels->path, at("j/masks"));
  EXPECT_EQ(found.root, at("j/videos"));

  write("j/boxes.csv", "image,class,left,top,right,bottom\nwalk/0,a,0,0,2,3\n");
  found = find("j");
  ASSERT_TRUE(found.labels);
  EXPECT_EQ(found.labels->format, LabelFormat::kCsv);
  EXPECT_EQ(found.labels->outlines, at("j/masks"));
  EXPECT_EQ(found.root, at("j/videos"));
  EXPECT_THAT(found.remarks, IsEmpty());
}

TEST_F(MaskLabels, FoldersOfLabelsHoldNoImages) {
  write("k/videos/walk.mp4");
  write("k/masks/walk/000000.png", "no PNG");
  EXPECT_EQ(find_sources(at("k")).front().root, at("k/videos"));

  add("ade/images/1.png", "ade/annotations/1.png", two_);  // grey: of classes
  SourceSpec spec;
  spec.root = "ade";
  const auto dataset = open_frames_dataset(spec, folder_.path());
  EXPECT_THAT(ids_of(*dataset), ElementsAre("images/1"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 folder of labels not taken for images in ade: annotations"));
  fs::remove_all(at("ade/images"));
  EXPECT_THAT(ids_of(*open_frames_dataset(spec, folder_.path())), ElementsAre("annotations/1"))
      << "alone they may be anything";

  add("flow/training/image_2/1.png", "flow/training/flow_occ/1.png", two_);
  write("flow/training/disp_noc_0/1.png", "no PNG");
  spec.root = "flow";
  EXPECT_THAT(ids_of(*open_frames_dataset(spec, folder_.path())),
              ElementsAre("training/image_2/1"));
}

TEST_F(MaskLabels, AreFoundBesideImages) {
  const auto find = [&](const char* folder) { return find_sources(at(folder)).front(); };
  add("fudan/images/1.png", "fudan/masks/1.png", two_);
  FoundSource found = find("fudan");
  ASSERT_TRUE(found.labels);
  EXPECT_EQ(found.labels->format, LabelFormat::kMasks);
  EXPECT_EQ(found.labels->path, at("fudan/masks"));
  EXPECT_EQ(found.root, at("fudan/images"));

  write("fudan/boxes.csv", "image,class,left,top,right,bottom\n1.png,a,0,0,2,3\n");
  found = find("fudan");
  ASSERT_TRUE(found.labels);
  EXPECT_EQ(found.labels->format, LabelFormat::kCsv);
  EXPECT_EQ(found.labels->outlines, at("fudan/masks"));
  EXPECT_THAT(found.remarks, IsEmpty());

  add("davis/JPEGImages/bear/1.png", "davis/Annotations/bear/1.png", two_, IndexPng::kPalette);
  found = find("davis");
  ASSERT_TRUE(found.labels);
  EXPECT_EQ(found.labels->path, at("davis/Annotations"));

  // Grey ones there are of classes; and images beside images are no masks.
  add("ade/images/1.png", "ade/annotations/1.png", two_);
  images({"flat/1.png", "colours/images/1.png"}, kMaskedImage);
  write("colours/masks/1.png", "no PNG");
  for (const char* folder : {"ade", "flat", "colours"}) EXPECT_FALSE(find(folder).labels) << folder;
  add("annotations/fudan/images/1.png", "annotations/fudan/masks/1.png", two_);
  EXPECT_TRUE(find("annotations/fudan").labels) << "what is above is called anything";
}

}  // namespace
}  // namespace eventgan
