#include "stages/frames/decoding/index_mask.h"

#include "manifests/values/outlines.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

using testing::IndexPng;

constexpr ImageSize kMaskSize{3, 5};

TEST(IndexMask, HasTheEdgesOfEachObject) {
  const TemporaryFolder folder;
  const std::vector<int> pixels{0, 2, 2, 0, 7,  //
                                0, 2, 0, 7, 7,  //
                                2, 0, 0, 7, 255};
  for (const IndexPng kind : {IndexPng::kGrey8, IndexPng::kPalette, IndexPng::kGrey16}) {
    testing::write_index_image(folder / "a.png", kMaskSize, pixels, kind);
    const auto mask = IndexMask::read(folder / "a.png", "a.png");
    ASSERT_FALSE(is_fault(mask)) << mask.fault().reason;
    EXPECT_EQ(mask->size(), kMaskSize);
    EXPECT_EQ(mask->has_palette(), kind == IndexPng::kPalette);
    if (kind == IndexPng::kGrey16) {  // 255 is a number like others
      EXPECT_THAT(mask->indices(), ElementsAre(2, 7, 255));
      EXPECT_THAT(mask->outline(255).rings,
                  ElementsAre(ElementsAre(Point{5, 2}, Point{5, 3}, Point{4, 3}, Point{4, 2})));
    } else {
      EXPECT_THAT(mask->indices(), ElementsAre(2, 7));
      EXPECT_TRUE(mask->outline(255).empty());
    }
    for (const int index : {2, 7}) {
      const GreyImage drawn = mask_of(mask->outline(index), kMaskSize);
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        EXPECT_EQ(drawn.pixels[i] != 0, pixels[i] == index) << index << " at " << i;
      }
    }
    EXPECT_TRUE(mask->outline(1).empty());
  }
}

TEST(IndexMask, OfOneObjectMayBeWhiteOnBlack) {
  const TemporaryFolder folder;
  const std::vector<int> pixels{0, 255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  testing::write_index_image(folder / "a.png", kMaskSize, pixels);
  const auto grey = IndexMask::read(folder / "a.png", "a.png");
  EXPECT_THAT(grey->indices(), ElementsAre(1));
  EXPECT_EQ(bounds(grey->outline(1)), (Rectangle{1, 0, 2, 1}));
  testing::write_index_image(folder / "a.png", kMaskSize, pixels, IndexPng::kPalette);
  EXPECT_THAT(IndexMask::read(folder / "a.png", "a.png")->indices(), IsEmpty());
}

TEST(IndexMask, ThatIsNoneIsAFault) {
  const TemporaryFolder folder;
  const auto fault = [&](const std::string& name) {
    const auto read = IndexMask::read(folder / name, "masks/" + name);
    return is_fault(read) ? read.fault().reason : "no fault";
  };
  EXPECT_THAT(fault("a.png"), HasSubstr("expected a readable file"));
  write_flat_image(folder / "a.jpg", kMaskSize, 9);
  EXPECT_EQ(fault("a.jpg"), "expected a PNG, got a file of another kind, in masks/a.jpg");
  write_file(folder / "a.png", "");
  EXPECT_EQ(fault("a.png"), "expected an image, got an empty file, in masks/a.png");
  std::vector<int> many(1001);
  for (int i = 0; i < 1001; ++i) many[static_cast<std::size_t>(i)] = i;
  testing::write_index_image(folder / "a.png", {1, 1001}, many, IndexPng::kGrey16);
  EXPECT_EQ(fault("a.png"), "no fault");
  many[0] = 1001;
  testing::write_index_image(folder / "a.png", {1, 1001}, many, IndexPng::kGrey16);
  EXPECT_EQ(fault("a.png"), "expected at most 1000 objects, got 1001, in masks/a.png");
}

TEST(IndexMask, OfTooManyCornersIsAFault) {
  const TemporaryFolder folder;
  // 501 x 1001 pixels of a checkerboard, of which 250'751 have four corners each.
  std::vector<int> board(501 * 1001);
  for (std::size_t i = 0; i < board.size(); i += 2) board[i] = 1;
  testing::write_index_image(folder / "a.png", {501, 1001}, board);
  EXPECT_EQ(fault_of(IndexMask::read(folder / "a.png", "a.png")),
            "expected at most 1000000 corners of outlines, got 1003004, in a.png");
}

}  // namespace
}  // namespace eventgan
