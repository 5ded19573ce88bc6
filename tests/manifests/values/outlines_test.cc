#include "manifests/values/outlines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::Optional;

GreyImage drawn(const std::vector<std::string>& rows) {
  GreyImage mask{{static_cast<int>(rows.size()), static_cast<int>(rows.at(0).size())}, {}};
  for (const std::string& row : rows) {
    for (const char pixel : row) mask.pixels.push_back(pixel == '#' ? 1 : 0);
  }
  return mask;
}

GreyImage random_mask(ImageSize size, double share, unsigned seed) {
  std::mt19937 random(seed);
  GreyImage mask{size, {}};
  for (std::size_t i = 0; i < size.pixel_count(); ++i) {
    mask.pixels.push_back(random() < share * std::mt19937::max() ? 1 : 0);
  }
  return mask;
}

/// How often the rings wind around a point: the sum of the angles under which it sees the edges.
int winding(const Outline& outline, double x, double y) {
  double angle = 0;
  for (const auto& ring : outline.rings) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Point a{ring[i].x - x, ring[i].y - y};
      const Point b{ring[(i + 1) % ring.size()].x - x, ring[(i + 1) % ring.size()].y - y};
      angle += std::atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y);
    }
  }
  return static_cast<int>(std::lround(angle / (2 * std::acos(-1))));
}

TEST(Outlines, OfPixelsAreClockwiseAndHolesRunTheOtherWay) {
  Outline outline = outline_of(drawn({"...", ".#."}));
  ASSERT_EQ(outline.rings.size(), 1U);
  EXPECT_THAT(outline.rings[0],
              ::testing::UnorderedElementsAre(Point{1, 1}, Point{2, 1}, Point{2, 2}, Point{1, 2}));
  EXPECT_EQ(winding(outline, 1.5, 1.5), 1);
  const GreyImage mask = drawn({"#####", "#...#", "#.#.#", "#...#", "#####"});
  outline = outline_of(mask);
  EXPECT_EQ(outline.rings.size(), 3U);
  EXPECT_EQ(winding(outline, 1.5, 1.5), 0);
  EXPECT_EQ(winding(outline, 2.5, 2.5), 1);
  EXPECT_EQ(mask_of(outline, mask.size), mask);
  EXPECT_EQ(outline_of(drawn({"#.", ".#"})).rings.size(), 2U);
}

TEST(Outlines, OfMasksGiveThemBack) {
  for (const ImageSize size : {ImageSize{1, 1}, {1, 17}, {19, 1}, {23, 31}}) {
    for (const double share : {0.0, 0.1, 0.5, 0.9, 1.0}) {
      const GreyImage mask = random_mask(size, share, 7);
      EXPECT_EQ(mask_of(outline_of(mask), size), mask) << to_string(size) << " " << share;
    }
  }
  EXPECT_TRUE(outline_of({{0, 0}, {}}).empty());
}

TEST(Outlines, CoverThePixelsWhoseCentresTheyWindAround) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-8, 40);
  for (int trial = 0; trial < 20; ++trial) {
    Outline outline;
    for (int ring = 0; ring < 3; ++ring) {
      outline.rings.emplace_back();
      for (int corner = 0; corner < 5; ++corner) {
        outline.rings.back().push_back({place(random), place(random)});
      }
    }
    const GreyImage mask = mask_of(outline, {30, 32});
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 32; ++x) {
        EXPECT_EQ(mask.pixels[std::size_t(y * 32 + x)], winding(outline, x + 0.5, y + 0.5) != 0);
      }
    }
  }
}

TEST(Outlines, SideBySideCoverEachPixelOnce) {
  const Outline left{{{{0, 0}, {2.5, 0}, {4.5, 4}, {0, 4}}}};
  const Outline right{{{{2.5, 0}, {8, 0}, {8, 4}, {4.5, 4}}}};
  const GreyImage a = mask_of(left, {4, 8}), b = mask_of(right, {4, 8});
  for (std::size_t i = 0; i < a.pixels.size(); ++i) EXPECT_EQ(a.pixels[i] + b.pixels[i], 1);
}

TEST(Outlines, PartsMayOverlapWhicheverWayTheyRun) {
  const Outline outline = outline_of_parts({{{0, 0}, {4, 0}, {4, 4}, {0, 4}},
                                            {{2, 2}, {2, 6}, {6, 6}, {6, 2}},
                                            {{0, 0}, {1, 1}},
                                            {{0, 0}, {1, 1}, {2, 2}}});
  EXPECT_EQ(outline.rings.size(), 2U);
  EXPECT_EQ(mask_of(outline, {6, 6}),
            drawn({"####..", "####..", "######", "######", "..####", "..####"}));
  EXPECT_EQ(bounds(outline), (Rectangle{0, 0, 6, 6}));
  EXPECT_EQ(bounds({}), Rectangle{});
}

/// A square of side 2 clockwise, back at its first corner, its upper left one.
std::vector<Point> square(double x, double y) {
  return {{x, y}, {x + 2, y}, {x + 2, y + 2}, {x, y + 2}, {x, y}};
}

std::vector<Point> chained(const std::vector<std::vector<Point>>& parts) {
  std::vector<Point> ring;
  for (const auto& part : parts) ring.insert(ring.end(), part.begin(), part.end());
  return ring;
}

TEST(Outlines, PartsInOneRingAreThoseWithoutTheLinesBetweenThem) {
  const GreyImage three = drawn({"##......##", "##......##", "..........", "..........",  //
                                 "##........", "##........"});
  std::vector<Point> closed = chained({square(0, 0), square(8, 0), square(0, 4)});
  // one line from the last part to the first; the lines alone would cover a triangle
  EXPECT_EQ(mask_of(outline_of_parts({closed}), three.size), three);
  std::reverse(closed.begin(), closed.end());
  EXPECT_EQ(mask_of(outline_of_parts({closed}), three.size), three);
  std::reverse(closed.begin(), closed.end());
  closed.push_back({0, 0});
  EXPECT_EQ(mask_of(outline_of_parts({closed}), three.size), three);
  EXPECT_EQ(outline_of_parts({closed}).rings.size(), 3U);
  EXPECT_EQ(outline_of_parts({chained({square(0, 0), square(8, 0)})}).rings.size(), 2U);
}

TEST(Outlines, ATriangleOfDoubledCornersIsNoLineBetweenParts) {
  const Outline outline = outline_of_parts({{{0, 0}, {0, 0}, {4, 0}, {4, 0}, {0, 4}, {0, 4}}});
  ASSERT_EQ(outline.rings.size(), 1U);
  EXPECT_EQ(twice_area(outline.rings[0]), 16);
}

TEST(Outlines, HolesAtTheEndOfALineStayHoles) {
  std::vector<Point> ring{{0, 0}, {6, 0}, {6, 6}, {0, 6}, {0, 0}};  // a hole, the other way round
  for (const Point corner : std::vector<Point>{{2, 2}, {2, 4}, {4, 4}, {4, 2}, {2, 2}, {0, 0}}) {
    ring.push_back(corner);
  }
  const GreyImage holed = drawn({"######", "######", "##..##", "##..##", "######", "######"});
  EXPECT_EQ(mask_of(outline_of_parts({ring}), holed.size), holed);
  std::reverse(ring.begin(), ring.end());
  EXPECT_EQ(mask_of(outline_of_parts({ring}), holed.size), holed);
}

TEST(Outlines, LobesTheOtherWayTakeNothingFromOtherParts) {
  const std::vector<Point> part{{0, 0}, {4, 0}, {4, 4}, {0, 4}};
  const Outline outline = outline_of_parts(
      {part, {{3, 1}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {20, 0}, {20, 10}, {8, 10}}});
  const GreyImage mask = mask_of(outline, {4, 4});
  EXPECT_EQ(std::count(mask.pixels.begin(), mask.pixels.end(), 1), 16);
  // A bow-tie has no area by signs. Centres on an edge belong to what is right of it.
  const Outline bow = outline_of_parts({{{0, 0}, {4, 4}, {4, 0}, {0, 4}}});
  EXPECT_EQ(mask_of(bow, {4, 4}), drawn({"...#", "#.##", "#.##", "...#"}));
}

TEST(Outlines, FarCornersAreCutOffAndRingsFilledByTurns) {
  for (const double far : {3e9, 3e38}) {
    EXPECT_EQ(mask_of({{{{0, 0}, {1, 0}, {1, far}, {0, far}}}}, {2, 2}), drawn({"#.", "#."}));
    EXPECT_EQ(mask_of({{{{0, -far}, {1, -far}, {1, far}, {0, far}}}}, {2, 2}), drawn({"#.", "#."}));
    EXPECT_EQ(mask_of({{{{0, far}, {1, far}, {1, 2 * far}}}}, {2, 2}), drawn({"..", ".."}));
  }
  const std::vector<Point> twice = chained({square(0, 0), square(0, 0)});
  EXPECT_EQ(mask_of({{twice}}, {2, 2}), drawn({"##", "##"}));
  EXPECT_EQ(mask_of({{twice}}, {2, 2}, FillRule::kByTurns), drawn({"..", ".."}));
  EXPECT_EQ(mask_of({{square(0, 0)}}, {2, 2}, FillRule::kByTurns), drawn({"##", "##"}));
}

TEST(Outlines, CornersAreCountedBeforeTheyAreMade) {
  for (const double share : {0.0, 0.1, 0.5, 0.9, 1.0}) {
    const GreyImage mask = random_mask({23, 31}, share, 5);
    EXPECT_EQ(corner_count(mask.pixels, mask.size), corner_count(outline_of(mask))) << share;
  }
  // Two objects side by side, and one of two pixels that touch at a corner.
  EXPECT_EQ(
      corner_count(std::vector<std::uint16_t>{1, 2, 2, 0, 300, 0, 0, 0, 300, 0}, ImageSize{2, 5}),
      16U);
}

TEST(Outlines, RunLengthsAreCocos) {
  const GreyImage mask = drawn({"##.", ".#."});
  EXPECT_THAT(run_lengths(mask), ElementsAre(0, 1, 1, 2, 2));
  EXPECT_THAT(mask_of(std::vector<std::uint32_t>{0, 1, 1, 2, 2}, ImageSize{2, 3}), Optional(mask));
  EXPECT_EQ(mask_of(std::vector<std::uint32_t>{0, 1, 1, 2}, ImageSize{2, 3}), std::nullopt);
  EXPECT_EQ(mask_of(std::vector<std::uint32_t>{4294967295U, 2}, ImageSize{2, 3}), std::nullopt);
  // The example of pycocotools' mask.py.
  EXPECT_EQ(compressed({6, 1, 40, 4, 5, 4, 5, 4, 21}), "61X13mN000`0");
}

TEST(Outlines, CompressedRunLengthsAreReadBack) {
  for (const double share : {0.0, 0.02, 0.5, 1.0}) {
    const GreyImage mask = random_mask({97, 211}, share, 11);
    const auto runs = run_lengths(mask);
    EXPECT_THAT(run_lengths(compressed(runs)), Optional(runs));
    EXPECT_THAT(mask_of(runs, mask.size), Optional(mask));
  }
  for (const char* damaged : {" ", "p", "P", "PPPPPPPPPP1", "O", "\x7f"}) {
    EXPECT_EQ(run_lengths(std::string_view(damaged)), std::nullopt) << damaged;
  }
}

TEST(Outlines, TextIsReadBack) {
  const Outline outline{{{{0, 0.5}, {1e6, -3}, {0.1, 7}}, {{1, 1}, {2, 2}, {3, 1}}}};
  EXPECT_EQ(outline_text(outline), "[[0,0.5,1000000,-3,0.1,7],[1,1,2,2,3,1]]");
  const auto read = read_outline(outline_text(outline));
  ASSERT_TRUE(read);
  EXPECT_EQ(outline_text(*read), outline_text(outline));
  EXPECT_EQ(outline_text({}), "");
  EXPECT_THAT(read_outline(""), Optional(Outline{}));
  for (const char* damaged :
       {"[", "[]", "[[]]", "[[1,2]]", "[[1,2,3,4]]", "[[1,2,3,4,5]]", "[[1,2,3,4,5,6]",
        "[[1,2,3,4,5,nan]]", "[[1,2,3,4,5,1e60]]", "[[1,2,3,4,5,6]]x", "[[1,2,3,4,5,6],]", "{}"}) {
    EXPECT_EQ(read_outline(damaged), std::nullopt) << damaged;
  }
}

}  // namespace
}  // namespace eventgan
