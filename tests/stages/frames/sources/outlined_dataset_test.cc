#include "stages/frames/sources/outlined_dataset.h"

#include "manifests/values/outlines.h"
#include "stages/frames/sources/open_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

constexpr ImageSize kImageSize{3, 5};

/// Images with a table of boxes, and masks.
class Outlines : public FolderTest {
 protected:
  Outlines() { spec_.outlines = "masks"; }

  /// An image of 5 x 3 for each name below images, with two boxes each: its left two columns, and
  /// its right two.
  void add_images(const Texts& names) {
    std::string table = "image,class,left,top,right,bottom\n";
    for (const std::string& name : names) {
      images({"images/" + name}, kImageSize);
      table += name + ",a,0,0,2,3\n" + name + ",b,3,0,5,3\n";
    }
    write("boxes.csv", table);
    spec_.root = "images";
    spec_.labels = LabelSpec{LabelFormat::kCsv, "boxes.csv"};
  }
  void write_mask(const std::string& name, const std::vector<int>& pixels,
                  ImageSize size = kImageSize) const {
    testing::write_index_image(at("masks/" + name), size, pixels);
  }
  std::unique_ptr<Dataset> open() const { return open_dataset(spec_, folder_.path()); }
  /// Where the outlines of the only image's boxes lie.
  std::vector<Rectangle> outlined() const {
    std::vector<Rectangle> all;
    for (const Box& box : annotation_of(*open()).boxes) all.push_back(bounds(box.outline));
    return all;
  }
  std::string fault() const { return fault_of(*open()); }

  const std::vector<int> both_{1, 1, 0, 0, 0,  //
                               1, 0, 0, 2, 2,  //
                               0, 0, 0, 0, 2};
  SourceSpec spec_;
};

TEST_F(Outlines, AreThoseOfTheMasks) {
  add_images({"1.png"});
  write_mask("1.png", both_);
  const Annotation read = annotation_of(*open());
  ASSERT_THAT(read.boxes, SizeIs(2));
  EXPECT_EQ(read.boxes[0].xyxy, (Rectangle{0, 0, 2, 3}));
  EXPECT_THAT(read.boxes[0].outline.rings,
              ElementsAre(ElementsAre(Point{2, 0}, Point{2, 1}, Point{1, 1}, Point{1, 2},
                                      Point{0, 2}, Point{0, 0})));
  EXPECT_EQ(bounds(read.boxes[1].outline), (Rectangle{3, 1, 5, 3}));
  EXPECT_THAT(open()->annotation_files(), ElementsAre("boxes.csv", "masks/1.png"));
  EXPECT_THAT(open()->notes(), IsEmpty());
}

TEST_F(Outlines, AnObjectThatIsNotSeenHasNone) {
  add_images({"1.png"});
  write_mask("1.png", {0, 0, 0, 0, 0, 0, 0, 0, 2, 2, 0, 0, 0, 0, 2});
  EXPECT_TRUE(annotation_of(*open()).boxes.at(0).outline.empty());
  EXPECT_FALSE(annotation_of(*open()).boxes.at(1).outline.empty());
}

TEST_F(Outlines, LieAtTheImagesPathOrRightInTheFolder) {
  add_images({"a/1.png", "a/2.png", "b/1.png", "c/3.jpg"});
  // 1.png is of a/1 or b/1.
  for (const char* name : {"a/1.png", "1.png", "2.PNG", "3.png"}) write_mask(name, both_);
  const auto dataset = open();
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("boxes.csv", "masks/2.PNG", "masks/3.png", "masks/a/1.png"));
  EXPECT_THAT(dataset->notes(), Contains("no index mask for 1 of 4 labelled frames in masks: boxes "
                                         "without outlines, first of b/1"));
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(annotation_of(*dataset, i).boxes.at(0).outline.empty(), i == 2) << i;
  }
}

TEST_F(Outlines, NumbersCountBoxesThatAreLeftOut) {
  add_images({"1.png"});
  write("boxes.csv",
        "image,class,left,top,right,bottom\n1.png,a,7,0,9,3\n1.png,a,0,0,2,3\n"
        "1.png,a,-9,0,-7,3\n1.png,b,3,0,5,3\n");
  write_mask("1.png", {2, 2, 0, 0, 0, 0, 0, 1, 4, 4, 3, 0, 0, 0, 4});
  EXPECT_THAT(annotation_of(*open()).left_out_at, ElementsAre(0u, 2u));
  EXPECT_THAT(outlined(), ElementsAre(Rectangle{0, 0, 2, 1}, Rectangle{3, 1, 5, 3}));
}

TEST_F(Outlines, BoxesKeepTheirOwn) {
  images({"images/1.png"}, kImageSize);
  write("classes.txt", "a\n");
  write("labels/1.txt", "0 0 0 0.4 0 0.4 1\n0 0.8 0.5 0.4 1\n");
  spec_.root = "images";
  spec_.labels = LabelSpec{LabelFormat::kYolo, "."};
  write_mask("1.png", both_);
  EXPECT_THAT(annotation_of(*open()).boxes.at(0).outline.rings,
              ElementsAre(ElementsAre(Point{0, 0}, Point{2, 0}, Point{2, 3})));
  EXPECT_EQ(outlined().at(1), (Rectangle{3, 1, 5, 3}));
}

TEST_F(Outlines, AMaskThatDoesNotFitIsAFault) {
  add_images({"1.png"});
  write_mask("1.png", std::vector<int>(12), {3, 4});
  EXPECT_EQ(fault(), "expected a mask of 5x3, as the image is, got 4x3, in masks/1.png");
  write_mask("1.png", {1, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0});
  EXPECT_EQ(fault(), "expected numbers of the 2 boxes in boxes.csv#1.png, got 3, in masks/1.png");
  write_mask("1.png", {1, 0, 0, 0, 0, 0, 2, 2, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(
      fault(),
      "expected most pixels of number 2 in the box from (3, 0) to (5, 3) of boxes.csv#1.png, got "
      "them from (1, 1) to (3, 2), in masks/1.png");
  write("masks/1.png", "no PNG");
  EXPECT_EQ(fault(), "expected a PNG, got a file of another kind, in masks/1.png");
}

TEST_F(Outlines, AMaskOfAllObjectsOrOfClassesIsAFault) {
  add_images({"1.png"});
  write_mask("1.png", {255, 255, 0, 0, 0, 0, 0, 0, 255, 255, 0, 0, 0, 0, 0});
  EXPECT_EQ(fault(),
            "expected a number for each of the 2 boxes in boxes.csv#1.png, got white (255) alone, "
            "in masks/1.png");
  // Number 1 has 2 columns in its box, 2 in the 2 pixels (and 0.1) beside it, and 2 beyond.
  write_flat_image(at("images/1.png"), {3, 9}, 9);
  write_mask("1.png",
             {1, 1, 0, 1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0},
             {3, 9});
  EXPECT_THAT(fault(), HasSubstr("expected most pixels of number 1 in the box from (0, 0) to (2, "
                                 "3) of boxes.csv#1.png, got them from (0, 0) to (7, 3)"));
  write_mask("1.png",
             {1, 1, 0, 1, 0, 1, 0, 0, 0, 1, 1, 1, 1, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0},
             {3, 9});
  EXPECT_EQ(fault(), "no fault") << "9 of 11";
}

TEST_F(Outlines, AFolderWithoutAnyIsRefused) {
  add_images({"1.png"});
  EXPECT_THROWS(open(), InputError, "masks");
  write_mask("2.png", both_);
  EXPECT_THROWS(open(), InputError,
                "expected index masks of the labelled images, 1.png and so on, got of "
                "none of the 1, in masks");
}

TEST_F(Outlines, ServeOtherDatasets) {
  spec_.dataset = DatasetKind::kKittiObject;
  spec_.root = "kitti";
  images({"kitti/image_2/000003.png"}, kImageSize);
  write("kitti/label_2/000003.txt",
        "Car 0 0 0 0 0 2 3 1 1 1 1 1 9 0\nDontCare -1 -1 -10 3 0 5 3 -1 -1 -1 -1000 -1000 -1000 "
        "-10\n");
  fs::create_directories(at("kitti/prev_2"));
  write_mask("image_2/000003.png", both_);
  EXPECT_THAT(outlined(), ElementsAre(Rectangle{0, 0, 2, 2}, Rectangle{3, 1, 5, 3}));
}

}  // namespace
}  // namespace eventgan
