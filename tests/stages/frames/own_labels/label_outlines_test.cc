// Outlines that labels have of themselves: COCO's segmentation, YOLO's segment lines.

#include "manifests/values/outlines.h"
#include "stages/frames/own_labels/yolo_text.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

/// A mask's rows, '#' where it is covered.
std::vector<std::string> drawn(const Outline& outline, ImageSize size) {
  const GreyImage mask = mask_of(outline, size);
  std::vector<std::string> rows;
  for (int y = 0; y < size.height; ++y) {
    std::string& row = rows.emplace_back();
    for (int x = 0; x < size.width; ++x) {
      row += mask.pixels[static_cast<std::size_t>(y * size.width + x)] != 0 ? '#' : '.';
    }
  }
  return rows;
}

/// One image of 5 x 4 with one box.
class CocoOutlines : public FolderTest {
 protected:
  static constexpr ImageSize kSize{4, 5};

  CocoOutlines() { images({"images/1.png"}, kSize); }

  /// Of annotations of one image.
  std::unique_ptr<Dataset> open(const std::string& annotations, ImageSize size = kSize) const {
    write("instances.json", R"({"images": [{"id": 7, "file_name": "1.png", "height": )" +
                                std::to_string(size.height) +
                                ", \"width\": " + std::to_string(size.width) +
                                R"(}], "categories": [{"id": 3, "name": "person"}],
                                "annotations": [)" +
                                annotations + "]}");
    SourceSpec spec;
    spec.root = "images";
    spec.labels = LabelSpec{LabelFormat::kCoco, "instances.json"};
    return open_frames_dataset(spec, folder_.path());
  }
  /// `keys` of the only annotation.
  Outcome<Annotation> read(const std::string& keys, ImageSize size = kSize) const {
    return open(R"({"id": 17, "image_id": 7, "category_id": 3, )" + keys + "}", size)
        ->annotation("7");
  }
  Box box(const std::string& keys) const {
    const auto annotation = read(keys);
    if (!is_fault(annotation) && annotation->boxes.size() == 1) return annotation->boxes[0];
    ADD_FAILURE() << fault_of(annotation);
    return {};
  }
  std::string fault(const std::string& segmentation) const {
    return fault_of(read(R"("bbox": [1, 1, 2, 2], "segmentation": )" + segmentation));
  }
  Outline outline(const std::string& segmentation) const {
    return box(R"("bbox": [0, 0, 5, 4], "segmentation": )" + segmentation).outline;
  }
};

TEST_F(CocoOutlines, PolygonsAreParts) {
  // Two rectangles that overlap, the second one the other way round; edges, not centres.
  const Outline parts = outline("[[0, 0, 2, 0, 2, 3, 0, 3], [1, 1, 1, 4, 4.6, 4, 4.6, 1]]");
  ASSERT_THAT(parts.rings, SizeIs(2));
  EXPECT_THAT(parts.rings[0], ElementsAre(Point{0, 0}, Point{2, 0}, Point{2, 3}, Point{0, 3}));
  EXPECT_THAT(parts.rings[1], ElementsAre(Point{4.6, 1}, Point{4.6, 4}, Point{1, 4}, Point{1, 1}));
  EXPECT_THAT(drawn(parts, kSize), ElementsAre("##...", "#####", "#####", ".####"));
}

TEST_F(CocoOutlines, RunLengthsGoDownTheColumns) {
  // Of columns of 4: 5 pixels are not covered, 2 are (rows 1 and 2 of column 1), 3 are not (row 3
  // of column 1 and the first two of column 2), 6 are, the last 4 are not.
  const std::string plain = R"({"size": [4, 5], "counts": [5, 2, 3, 6, 4]})";
  EXPECT_THAT(drawn(outline(plain), kSize), ElementsAre("...#.", ".#.#.", ".###.", "..##."));
  // Compressed, 6 and 4 are told from 2 and 3 before them: 4 and 1.
  const std::string text = R"({"size": [4, 5], "counts": "52341"})";
  EXPECT_EQ(outline(text), outline(plain));
  EXPECT_EQ(outline(plain).rings[0][0], (Point{4, 0}));
  EXPECT_THAT(box(R"("bbox": [0, 0, 5, 4], "iscrowd": 1, "segmentation": )" + plain).ignore, true);
}

TEST_F(CocoOutlines, RunLengthsOfTooManyCornersAreAFault) {
  // A checkerboard, since the height is odd: 350,850 squares.
  images({"images/1.png"}, {701, 1001});
  std::string counts = "1";
  for (int i = 1; i < 701 * 1001; ++i) counts += ",1";
  EXPECT_THAT(fault_of(read(R"("bbox": [0, 0, 9, 9],
                               "segmentation": {"size": [701, 1001], "counts": [)" +
                                counts + "]}",
                            {701, 1001})),
              HasSubstr("a mask of at most 1000000 corners, got 1403400"));
}

TEST_F(CocoOutlines, ABoxWithoutSidesIsAroundItsOutline) {
  for (const char* none : {"", R"("bbox": null, )", R"("bbox": [], )"}) {
    const Box read =
        box(std::string(none) + R"("segmentation": [[1, 0.5, 4.25, 2, 2, 3], [0, 1, 1, 2, 0, 2]])");
    EXPECT_EQ(read.xyxy, (Rectangle{0, 0.5, 4.25, 3}));
    EXPECT_THAT(read.outline.rings, SizeIs(2));
  }
  EXPECT_EQ(box(R"("bbox": [1, 1, 2, 2], "segmentation": [[0, 0, 5, 0, 5, 4]])").xyxy,
            (Rectangle{1, 1, 3, 3}));
  EXPECT_THAT(fault_of(read(R"("segmentation": [])")),
              HasSubstr("(annotation 17): $.bbox: expected"));
}

TEST_F(CocoOutlines, MostlyCrowdsAreAWarning) {
  const auto warnings = [&](const Texts& crowds) {
    std::string all;
    for (std::size_t i = 0; i < crowds.size(); ++i) {
      all += (i > 0 ? ", {\"id\": " : "{\"id\": ") + std::to_string(i) +
             R"(, "image_id": 7, "category_id": 3, "bbox": [1, 1, 2, 2], "iscrowd": )" + crowds[i] +
             "}";
    }
    return open(all)->warnings();
  };
  EXPECT_THAT(warnings({"0", "true", "1", "0"}), IsEmpty());
  EXPECT_THAT(warnings({"0", "true", "1", "1"}),
              ElementsAre(HasSubstr("3 of 4 annotations have \"iscrowd\" 1")));
}

TEST_F(CocoOutlines, WithoutAreaThereIsNone) {
  for (const char* empty : {"[]", "[[]]", "null", "[[1, 1, 3, 3]]", "[[1, 1, 2, 2, 3, 3]]",
                            R"({"size": [4, 5], "counts": [20]})"}) {
    EXPECT_THAT(outline(empty).rings, IsEmpty()) << empty;
  }
  EXPECT_THAT(outline("[[1, 1, 3, 3], [0, 0, 1, 0, 1, 1]]").rings, SizeIs(1));
}

TEST_F(CocoOutlines, PartsThatAreLeftOutAreTold) {
  const auto told = [&](const std::string& segmentation) {
    return read(R"("bbox": [0, 0, 5, 4], "segmentation": )" + segmentation)->outlines_mended;
  };
  // A line there and back has no area either; a ring that is closed, or in two parts, has.
  EXPECT_THAT(told("[[1, 1, 3, 3], [0, 0, 1, 0, 1, 1], [], [0, 0, 2, 0, 2, 2, 2, 0, 0, 0]]"),
              ElementsAre("expected parts of an outline that have an area, got 3 of 4 without, in "
                          "instances.json (annotation 17)"));
  for (const char* sound : {"null", "[]", "[[0, 0, 1, 0, 1, 1, 0, 0]]",
                            "[[0, 0, 1, 0, 1, 1, 0, 0, 2, 2, 3, 2, 3, 3, 2, 2, 0, 0]]",
                            R"({"size": [4, 5], "counts": [20]})"}) {
    EXPECT_THAT(told(sound), IsEmpty()) << sound;
  }
  // Nothing is told of a box that is left out itself.
  const auto outside = read(R"("bbox": [50, 0, 5, 4], "segmentation": [[1, 1, 3, 3]])");
  EXPECT_THAT(outside->outlines_mended, IsEmpty());
  EXPECT_THAT(outside->left_out, SizeIs(1));
}

TEST_F(CocoOutlines, ABadOneIsAFaultOfTheImage) {
  const std::pair<const char*, const char*> cases[] = {
      {"[[1, 2, 3]]",
       "instances.json (annotation 17): $.segmentation[0]: expected x and y of each "
       "corner, got 3 numbers"},
      {"[1, 2, 3, 4, 5, 6]", "$.segmentation[0]: expected a"},
      {R"([["a", 2, 3, 4, 5, 6]])", "$.segmentation[0][0]: expected a number"},
      {"[[1e300, 2, 3, 4, 5, 6]]", "$.segmentation[0][0]: expected a number"},
      {"\"52341\"", "$.segmentation: expected an object"},
      {R"({"size": [5, 4], "counts": [20]})",
       "$.segmentation.size: expected 5x4, the image's size, got 4x5"},
      {R"({"counts": [20]})", "$.segmentation.size: expected"},
      {R"({"size": [4, 5], "counts": [-1, 21]})", "$.segmentation.counts[0]: expected an integer"},
      {R"({"size": [4, 5]})", "$.segmentation.counts: expected"}};
  for (const auto& [segmentation, why] : cases) {
    EXPECT_THAT(fault(segmentation), HasSubstr(why)) << segmentation;
  }
  for (const char* counts :
       {"[19]", "[21]", "[]", "[20, 4294967295]", R"("")", R"("4")", R"("e")", R"("\u0001")"}) {
    EXPECT_THAT(fault(R"({"size": [4, 5], "counts": )"s + counts + "}"),
                HasSubstr("$.segmentation.counts: expected run lengths of 20 pixels, got others"))
        << counts;
  }
}

// Of 40 x 30 pixels.
Annotation read_segments(const std::string& text) {
  const auto read =
      parse_yolo_text(text, parse_yolo_classes("cat\ndog\n", "classes.txt"), {30, 40}, "a.txt");
  EXPECT_FALSE(is_fault(read)) << read.fault().reason;
  return *read;
}

TEST(YoloOutlines, AreSharesOfTheImage) {
  const Annotation read =
      read_segments("1 0.25 0.2 0.125 0.4 0.5 0.5\n0 0.5 0.5 0.25 0.2\n0 0 0 1.005 0 1 1 0 1");
  ASSERT_THAT(read.boxes, SizeIs(3));
  // (10, 6), (5, 12), (20, 15) runs the other way round.
  EXPECT_THAT(read.boxes[0].outline.rings,
              ElementsAre(ElementsAre(Point{20, 15}, Point{5, 12}, Point{10, 6})));
  EXPECT_EQ(read.boxes[0].xyxy, (Rectangle{5, 6, 20, 15}));
  EXPECT_TRUE(read.boxes[1].outline.empty());
  EXPECT_THAT(
      read.boxes[2].outline.rings,
      ElementsAre(ElementsAre(Point{0, 0}, Point{1.005 * 40, 0}, Point{40, 30}, Point{0, 30})));
}

TEST(YoloOutlines, OneWithoutAreaIsABoxAndTold) {
  const Annotation read = read_segments("0 0 0 0.5 0.5 0.25 0.25\n1 0.5 0.5 0.7 0.5 0.7 0.7");
  ASSERT_THAT(read.boxes, SizeIs(2));
  EXPECT_TRUE(read.boxes[0].outline.empty());
  EXPECT_THAT(read.outlines_mended,
              ElementsAre("expected parts of an outline that have an area, got 1 of 1 without, in "
                          "a.txt:1"));
}

TEST(YoloOutlines, PartsAreJoinedByABridge) {
  // A square from (4, 3) to (8, 6) and one from (20, 15) to (24, 18), there and back again.
  const Annotation read = read_segments(
      "0 0.1 0.1 0.2 0.1 0.2 0.2 0.5 0.5 0.6 0.5 0.6 0.6 0.5 0.6 0.5 0.5 0.2 0.2 0.1 0.2");
  const GreyImage mask = mask_of(read.boxes.at(0).outline, {30, 40});
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      const bool in_first = x >= 4 && x < 8 && y >= 3 && y < 6;
      const bool in_second = x >= 20 && x < 24 && y >= 15 && y < 18;
      EXPECT_EQ(mask.pixels[static_cast<std::size_t>(40 * y + x)] != 0, in_first || in_second)
          << x << ", " << y;
    }
  }
}

TEST(YoloOutlines, ADatasetWithJointsHasNone) {
  const YoloSchema pose = parse_yolo_yaml("names: [a]\nkpt_shape: [1, 2]", "data.yaml");
  const auto joint = parse_yolo_text("0 0.5 0.5 0.2 0.2 0.5 0.5", pose, {30, 40}, "a.txt");
  ASSERT_FALSE(is_fault(joint));
  EXPECT_THAT(joint->persons, SizeIs(1));
  EXPECT_TRUE(joint->boxes.at(0).outline.empty());
  EXPECT_TRUE(
      is_fault(parse_yolo_text("0 0.5 0.5 0.2 0.2 0.5 0.5 0.1 0.1", pose, {30, 40}, "a.txt")));
}

}  // namespace
}  // namespace eventgan
