#include "stages/labels/label_mapping.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <utility>

namespace eventgan {
namespace {

using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// A KITTI image in a volume of half its size.
const Placement kHalf{{375, 1242}, {188, 621}, {188, 621}, 0, 0};

/// The same image at its own size, cut to its middle: columns 421..820 and rows 100..274.
const Placement kMiddle{{375, 1242}, {375, 1242}, {175, 400}, -421, -100};

Box box(double left, double top, double right, double bottom) {
  Box made;
  made.xyxy = {left, top, right, bottom};
  return made;
}

Person person(std::vector<Joint> joints) {
  Person made;
  made.joints = std::move(joints);
  return made;
}

VolumeLabels mapped(const Annotation& annotation, const Placement& placement) {
  const Outcome<VolumeLabels> labels = map_labels(annotation, placement, "a.txt");
  if (is_fault(labels)) {
    ADD_FAILURE() << labels.fault().reason;
    return {};
  }
  return *labels;
}

/// The reason of the fault; empty if there is none.
std::string fault(const Annotation& annotation) {
  const Outcome<VolumeLabels> labels = map_labels(annotation, kHalf, "label_2/001497.txt");
  return is_fault(labels) ? labels.fault().reason : "";
}

std::string fault(const Box& one) { return fault(Annotation{"", {one}, {}}); }
std::string fault(const Person& one) { return fault(Annotation{"", {}, {one}}); }

TEST(MapLabels, KeepsTheOrderAndMapsEachBoxUncutAndCut) {
  EXPECT_TRUE(mapped({}, kHalf).boxes.empty());
  EXPECT_TRUE(mapped({}, kHalf).persons.empty());
  const std::vector<VolumeBox> halves =
      mapped({"", {box(0, 0, 1242, 375), box(621, 0, 622, 375), box(-1e6, 0, 1e6, 375)}, {}}, kHalf)
          .boxes;
  ASSERT_EQ(halves.size(), 3u);
  EXPECT_EQ(halves[0].clipped, (Rectangle{0, 0, 621, 188}));
  EXPECT_EQ(halves[1].unclipped, (Rectangle{310.5, 0, 311, 188}));
  EXPECT_EQ(halves[2].clipped, (Rectangle{0, 0, 621, 188}));
  EXPECT_EQ(halves[2].unclipped, (Rectangle{-5e5, 0, 5e5, 188}));
  for (const VolumeBox& one : halves) EXPECT_FALSE(one.ignore);
  // A crop: 400 - 421 = -21, 431 - 421 = 10; 150 - 100 = 50, 200 - 100 = 100. Of the second box it
  // leaves nothing.
  const std::vector<VolumeBox> cut =
      mapped({"", {box(400, 150, 431, 200), box(10, 150, 40, 200), box(500, 150, 540, 200)}, {}},
             kMiddle)
          .boxes;
  EXPECT_EQ(cut[0].unclipped, (Rectangle{-21, 50, 10, 100}));
  EXPECT_EQ(cut[0].clipped, (Rectangle{0, 50, 10, 100}));
  EXPECT_TRUE(is_empty(cut[1].clipped));
  EXPECT_EQ(cut[1].unclipped, (Rectangle{-411, 50, -381, 100}));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(cut[i].ignore, i == 1);
  // Without area a box is kept and ignored.
  for (const Box& one : {box(10, 20, 10, 40), box(10, 20, 30, 20)}) {
    EXPECT_TRUE(mapped({"", {one}, {}}, kHalf).boxes[0].ignore);
  }
}

TEST(MapLabels, WhatAStillsBordersHideIsCutEvenWhereALetterboxHasRoom) {
  // 100x50 without borders of 10 and 5 px, doubled: 160x80, 15 px from the top of 160x110.
  const Placement still{{50, 100}, {80, 160}, {110, 160}, 0, 15, 10, 5};
  const auto labels =
      mapped({"", {box(12, 6, 20, 49), box(30, 1, 40, 4), box(0, 0, 100, 50)}, {}}, still);
  // (12 - 10) 2 = 4, (20 - 10) 2 = 20; (6 - 5) 2 + 15 = 17, (49 - 5) 2 + 15 = 103, cut at 15 + 80.
  EXPECT_EQ(labels.boxes[0].unclipped, (Rectangle{4, 17, 20, 103}));
  EXPECT_EQ(labels.boxes[0].clipped, (Rectangle{4, 17, 20, 95}));
  EXPECT_FALSE(labels.boxes[0].ignore);
  EXPECT_EQ(labels.boxes[1].unclipped, (Rectangle{40, 7, 60, 13})) << "in the letterbox's border";
  EXPECT_TRUE(is_empty(labels.boxes[1].clipped));
  EXPECT_TRUE(labels.boxes[1].ignore);
  EXPECT_EQ(labels.boxes[2].clipped, (Rectangle{0, 15, 160, 95}));
  EXPECT_EQ(to_volume(still, Point{12, 6}), (Point{4.5, 17.5}));  // (12 - 10 + 0.5) 2 - 0.5
  EXPECT_EQ(to_source(still, Point{4.5, 17.5}), (Point{12, 6}));
  EXPECT_EQ(to_source(still, labels.boxes[0].unclipped), (Rectangle{12, 6, 20, 49}));
}

TEST(MapLabels, ABoxThatReachesIntoALetterboxesBorderIsCutAtTheImage) {
  // 100x50 in 60x40: 60x30, 5 px from the top. An edge maps as 0.6 x and 0.6 y + 5.
  const Placement letterbox{{50, 100}, {30, 60}, {40, 60}, 0, 5};
  const auto labels = mapped({"", {box(-10, -5, 50, 60)}, {}}, letterbox);
  EXPECT_EQ(labels.boxes[0].unclipped, (Rectangle{-6, 2, 30, 41}));
  EXPECT_EQ(labels.boxes[0].clipped, (Rectangle{0, 5, 30, 35}));
}

template <class Label>
Label with(Label label, void (*change)(Label&)) {
  change(label);
  return label;
}

/// A label and words of its fault; none if there is none.
template <class Label>
using Faults = std::pair<Label, const char*>;

template <class Label>
void expect_faults(const std::vector<Faults<Label>>& cases) {
  for (const auto& [label, words] : cases) {
    const std::string got = fault(label);
    EXPECT_THAT(got, HasSubstr(words));
    EXPECT_EQ(got.empty(), *words == '\0') << got;
  }
}

TEST(MapLabels, WhatABoxMustBeIsChecked) {
  const Box good = box(10, 10, 20, 30);
  Box dont_care = box(10, 10, 20, 20);
  dont_care.ignore = true;
  expect_faults<Box>({
      {box(937, 197, 1241, 374), ""},
      {box(-2.5, -1, 1243, 376), ""},  // slightly beyond the border
      {box(100, 100, 100, 120), ""},   // no width, but inside
      {box(-1e6, -1e6, 1e6, 1e6), ""},
      {box(1300, 20, 1400, 90),
       "expected an overlap with the image of 1242x375 pixels, got left 1300, top 20, right 1400, "
       "bottom 90, in box 1 of 1, in label_2/001497.txt"},
      {box(-10, 20, 0, 90), "expected an overlap"},
      {box(10, 375, 20, 380), "expected an overlap"},
      {box(10, -5, 20, -1), "expected an overlap"},
      {box(1e5, 0, 2e5, 375), "expected an overlap"},
      {box(20, 10, 10, 30), "expected left <= right"},
      {box(10, 30, 20, 10), "expected left <= right and top <= bottom"},
      {box(10, kNan, 20, 30), "expected edges within 1e6 pixels"},
      {box(10, 10, kInfinity, 30), "expected edges within 1e6 pixels"},
      {box(10, 10, 1e300, 20),
       "expected edges within 1e6 pixels, got left 10, top 10, right 1e+300, bottom 20, in box 1"},
      {box(-1000001, 10, 20, 20), "expected edges within 1e6 pixels"},
      {with<Box>(good, [](Box& one) { one.box3d[5] = kInfinity; }),
       "expected a finite box in 3-D, got inf, in box 1 of 1, in label_2/001497.txt"},
      {with<Box>(good, [](Box& one) { one.alpha = std::nanf(""); }), "finite alpha, got nan"},
      {with<Box>(good, [](Box& one) { one.truncation = static_cast<float>(1e300); }),
       "finite truncation, got inf"},
      {dont_care, ""},
      {with<Box>(dont_care, [](Box& one) { one.xyxy.right = 0; }), "expected left <= right"},
      {with<Box>(dont_care, [](Box& one) { one.xyxy.left = kNan; }), "edges within 1e6 pixels"},
      {with<Box>(dont_care, [](Box& one) { one.xyxy.right = 1e7; }), "edges within 1e6 pixels"},
  });
  EXPECT_THAT(fault(Annotation{"", {box(0, 0, 1, 1), box(1300, 20, 1400, 90)}, {}}),
              HasSubstr("in box 2 of 2"));
  dont_care.xyxy = {1300, 20, 1400, 90};  // may lie outside
  const auto labels = mapped({"", {dont_care}, {}}, kHalf);
  ASSERT_EQ(labels.boxes.size(), 1u);
  EXPECT_TRUE(labels.boxes[0].ignore);
  EXPECT_TRUE(is_empty(labels.boxes[0].clipped));
  EXPECT_EQ(labels.boxes[0].unclipped.left, 650);  // 1300 x 621/1242
}

TEST(MapLabels, MissingPointsStayAndOthersMove) {
  Person one = person({{kMissingPoint, 0}, {{100, 99}, 0}, {{-1, 99}, 1}});
  const auto labels = mapped({"", {}, {one}}, kMiddle);
  ASSERT_EQ(labels.persons.size(), 1u);
  EXPECT_EQ(labels.persons[0].joints,
            (std::vector<Point>{kMissingPoint, {100 - 421, 99 - 100}, {-1 - 421, 99 - 100}}));
  EXPECT_EQ(labels.persons[0].center, kMissingPoint);
  EXPECT_EQ(labels.persons[0].scale, -1);
  EXPECT_FALSE(labels.persons[0].head_box);
  EXPECT_FALSE(labels.persons[0].camera);
}

TEST(MapLabels, ScaleHeadBoxCentreAndCameraFollowTheImage) {
  const Placement placement{{100, 100}, {25, 400}, {25, 400}, 0, 0};  // x4 wide, /4 high
  Person one = person({{{10, 10}, 1}});
  one.center = {9.5, 9.5};
  one.scale = 3;
  one.head_box = Rectangle{4, 8, 6, 12};
  one.camera = Intrinsics{1000, 1000, 49.5, 49.5};
  const VolumePerson got = mapped({"", {}, {one}}, placement).persons[0];
  EXPECT_EQ(got.center, (Point{10 * 4 - 0.5, 10 * 0.25 - 0.5}));
  EXPECT_DOUBLE_EQ(got.scale, 3);  // sqrt(4 x 1/4) = 1
  EXPECT_EQ(got.head_box, (Rectangle{16, 2, 24, 3}));
  EXPECT_EQ(got.camera, (Intrinsics{4000, 250, 50 * 4 - 0.5, 50 * 0.25 - 0.5}));

  // kHalf: sqrt(621/1242 x 188/375).
  EXPECT_DOUBLE_EQ(mapped({"", {}, {one}}, kHalf).persons[0].scale, 3 * std::sqrt(0.5 * 188 / 375));
}

TEST(MapLabels, WhatAPersonMustBeIsChecked) {
  const Person good = person({{{10, 10}, 1}});
  expect_faults<Person>({
      {good, ""},
      {person({}), ""},
      {with<Person>(person({{kMissingPoint, 0}}),
                    [](Person& one) {
                      one.center = {-50, 9000};
                    }),
       ""},
      {person({{{1300, 10}, 1}, {{1241.5, 374.5}, 0}}), ""},  // the very corner
      {person({{{-0.5, -0.5}, 1}}), ""},                      // of the first pixel
      {person({{{1241.6, 10}, 1}}), "expected a joint inside the image"},
      {person({{{-0.6, 10}, 1}}), "expected a joint inside the image"},
      {person({{kMissingPoint, 0}, {{1300, 10}, 1}, {{10, 400}, 1}}),
       "expected a joint inside the image of 1242x375 pixels, got all annotated ones outside it, "
       "the first at (1300, 10), in person 1 of 1, in label_2/001497.txt"},
      {person({{{10, 10}, 1}, {{kNan, 3}, 1}}), "expected joints within 1e6 pixels"},
      {person({{{10, 10}, 1}, {{3, -1e7}, 1}}),
       "expected joints within 1e6 pixels, got (3, -1e+07), in person 1 of 1, in label_2"},
      {with<Person>(good,
                    [](Person& one) {
                      one.center = {3, kNan};
                    }),
       "centre"},
      {with<Person>(good,
                    [](Person& one) {
                      one.center = {1e308, 5};
                    }),
       "a centre within 1e6 pixels, got (1e+308, 5)"},
      {with<Person>(good, [](Person& one) { one.scale = kNan; }), "scale"},
      {with<Person>(good, [](Person& one) { one.scale = 1e7; }),
       "a scale of at most 1e6, got 1e+07"},
      {with<Person>(good,
                    [](Person& one) {
                      one.head_box = Rectangle{0, 0, kNan, 1};
                    }),
       "head box"},
      {with<Person>(good,
                    [](Person& one) {
                      one.head_box = Rectangle{-1e308, 0, 5, 5};
                    }),
       "a head box within 1e6 pixels, got left -1e+308"},
      {with<Person>(good,
                    [](Person& one) {
                      one.joints3d_mm = {{{0, 0, 1}}, {{0, kNan, 1}}};
                    }),
       "expected finite joints in 3-D, got (0, nan, 1) mm"},
      {with<Person>(good,
                    [](Person& one) {
                      one.joints3d_mm = {{{0, 0, 1}}, std::nullopt};
                    }),
       ""},
      {with<Person>(good,
                    [](Person& one) {
                      one.camera = Intrinsics{1, 1, kNan, 1};
                    }),
       "camera"},
      {with<Person>(good,
                    [](Person& one) {
                      one.camera = Intrinsics{1000, 1e308, 50, 50};
                    }),
       "a camera within 1e6 pixels, got f_x 1000"},
      {with<Person>(good, [](Person& one) { one.distortion = {.k1 = -0.2, .p2 = kNan}; }),
       "expected a finite lens distortion, got k1 -0.2"},
  });
}

/// How often an outline winds around a point: the sum of the angles under which it sees the edges.
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

/// Rings of up to nine corners anywhere in and around an image, either way round.
Outline random_outline(ImageSize image, std::mt19937& random) {
  const auto within = [&](double least, double most) {
    return std::uniform_real_distribution(least, most)(random);
  };
  Outline outline;
  for (int rings = 1 + static_cast<int>(random() % 3); rings > 0; --rings) {
    auto& ring = outline.rings.emplace_back();
    for (int corners = 3 + static_cast<int>(random() % 7); corners > 0; --corners) {
      ring.push_back({within(-0.4 * image.width, 1.4 * image.width),
                      within(-0.4 * image.height, 1.4 * image.height)});
    }
  }
  return outline;
}

Box outlined(Outline outline) {
  Box made = box(0, 0, 30, 30);
  made.outline = std::move(outline);
  return made;
}

TEST(MapLabels, AnOutlineMapsAsTheEdgesOfItsBox) {
  const Outline outline{{{{10, 20}, {30.5, 20}, {30.5, 41}}}};
  Box one = box(10, 20, 30.5, 41);
  one.outline = outline;
  const VolumeBox half = mapped({"", {one}, {}}, kHalf).boxes[0];
  const double down = 188.0 / 375;
  EXPECT_EQ(half.outline, (Outline{{{{5, 20 * down}, {15.25, 20 * down}, {15.25, 41 * down}}}}));
  EXPECT_FALSE(half.ignore);
  const VolumeBox none = mapped({"", {box(0, 0, 9, 9)}, {}}, kHalf).boxes[0];
  EXPECT_TRUE(none.outline.empty());
}

TEST(MapLabels, WhatAnOutlineCoversIsWhatItCoversInTheSource) {
  std::mt19937 random(7);
  // Odd sizes: a letterbox, a crop, both axes by other factors, and a still without its borders.
  for (const Placement& placement : {Placement{{37, 51}, {29, 40}, {41, 40}, 0, 6},
                                     Placement{{37, 51}, {37, 51}, {21, 17}, -17, -8},
                                     Placement{{37, 51}, {90, 23}, {90, 23}, 0, 0},
                                     Placement{{37, 51}, {29, 40}, {41, 40}, 0, 6, 5, 3}}) {
    for (int trial = 0; trial < 10; ++trial) {
      Box one = box(-30, -30, 90, 90);
      one.outline = random_outline(placement.source, random);
      const Outline got = mapped({"", {one}, {}}, placement).boxes[0].outline;
      for (int y = 0; y < placement.volume.height; ++y) {
        for (int x = 0; x < placement.volume.width; ++x) {
          const double source_x = (x + 0.5 - placement.offset_x) * (51 - 2 * placement.border_x) /
                                      placement.scaled.width +
                                  placement.border_x;
          const double source_y = (y + 0.5 - placement.offset_y) * (37 - 2 * placement.border_y) /
                                      placement.scaled.height +
                                  placement.border_y;
          ASSERT_EQ(winding(got, x + 0.5, y + 0.5), winding(one.outline, source_x, source_y));
        }
      }
    }
  }
}

TEST(MapLabels, AnOutlineThatACropLeavesNothingOfIsIgnoredWithItsBox) {
  Box one = box(400, 150, 460, 200);  // kMiddle shows it from x = 421 on
  one.outline = {{{{400, 150}, {420, 150}, {420, 200}}}};
  VolumeBox got = mapped({"", {one}, {}}, kMiddle).boxes[0];
  EXPECT_FALSE(is_empty(got.clipped));
  EXPECT_TRUE(got.ignore);
  EXPECT_EQ(got.outline, (Outline{{{{-21, 50}, {-1, 50}, {-1, 100}}}})) << "it is kept, uncut";
  one.outline.rings[0][1].x = 422;
  EXPECT_FALSE(mapped({"", {one}, {}}, kMiddle).boxes[0].ignore);
  one = box(400, 60, 460, 120);  // from (421, 100) on, whose corner the outline passes
  one.outline = {{{{400, 60}, {460, 60}, {400, 120}}}};
  EXPECT_TRUE(mapped({"", {one}, {}}, kMiddle).boxes[0].ignore);
  one.outline.rings[0][1].x = 490;
  EXPECT_FALSE(mapped({"", {one}, {}}, kMiddle).boxes[0].ignore);
}

TEST(MapLabels, OutlinesOfTooManyCornersAreAFault) {
  Annotation annotation{"", {box(0, 0, 9, 9), box(0, 0, 9, 9)}, {}};
  for (Box& one : annotation.boxes) one.outline.rings = {std::vector<Point>(500'000, {1, 1})};
  EXPECT_EQ(fault(annotation), "");
  annotation.boxes[1].outline.rings[0].push_back({2, 2});
  EXPECT_EQ(fault(annotation),
            "expected at most 1000000 corners of outlines, got 1000001, in label_2/001497.txt");
}

TEST(MapLabels, WhatAnOutlineMustBeIsChecked) {
  for (const double wrong : {kNan, HUGE_VAL, -1.1e6}) {
    EXPECT_THAT(fault(outlined({{{{0, 0}, {9, 0}, {9, wrong}}}})),
                HasSubstr("expected an outline within 1e6 pixels, got (9, "));
  }
  EXPECT_EQ(fault(outlined({{{{0, 0}, {9, 0}, {9, -1e6}}}})), "");
  EXPECT_EQ(fault(outlined({{{{31, 5}, {40, 5}, {40, 9}}}})),
            "expected an outline over its box, left 0, top 0, right 30, bottom 30, got one around "
            "left 31, top 5, right 40, bottom 9, in box 1 of 1, in label_2/001497.txt");
  EXPECT_EQ(fault(outlined({{{{30, 5}, {40, 5}, {40, 9}}}})), "");
  Box region = outlined({{{{31, 5}, {40, 5}, {40, 9}}}});
  region.ignore = true;
  EXPECT_THAT(fault(region), HasSubstr("expected an outline over its box"));
}

TEST(Clip, OfAnOutlineCoversTheSameWithinTheAreaAndHasNoCornerOutside) {
  std::mt19937 random(11);
  const Rectangle area{3, 2, 31, 22.5};
  for (int trial = 0; trial < 60; ++trial) {
    const Outline outline = random_outline({24, 35}, random);
    const Outline cut = clip(outline, area);
    for (const auto& ring : cut.rings) {
      ASSERT_GE(ring.size(), 3u);
      for (const Point& corner : ring) {
        ASSERT_TRUE(corner.x >= 3 && corner.x <= 31 && corner.y >= 2 && corner.y <= 22.5);
      }
    }
    for (double y = 2.25; y < 22.5; ++y) {
      for (double x = 3.25; x < 31; ++x) {
        ASSERT_EQ(winding(cut, x, y), winding(outline, x, y)) << trial << ": " << x << " " << y;
      }
    }
  }
}

TEST(Clip, OfAnOutlineWithinChangesNothingAndOfOneOutsideLeavesNothing) {
  const Outline within{{{{3, 2}, {31, 2}, {31, 22}}, {{5, 3}, {5, 4}, {6, 4}}}};
  EXPECT_EQ(clip(within, {3, 2, 31, 22}), within);
  EXPECT_TRUE(clip(within, {-9, -9, 2, 1}).empty());
  EXPECT_TRUE(clip(within, {31, 0, 40, 40}).empty()) << "they touch";
  EXPECT_TRUE(clip(within, {3, 21, 4, 30}).empty()) << "beside it";
  EXPECT_TRUE(clip(Outline(), {0, 0, 9, 9}).empty());
}

TEST(MapLabels, AProjectionThatIsNotFiniteIsAFault) {
  Annotation annotation;
  annotation.projection.emplace().fill(1);
  EXPECT_EQ(fault(annotation), "");
  (*annotation.projection)[3] = kNan;
  EXPECT_EQ(fault(annotation),
            "expected a finite projection in the volume, got nan, in label_2/001497.txt");
  // x' = s_x X + (s_x / 2 - 1/2 + offset) Z leaves double where the volume is larger.
  annotation.projection->fill(1e308);
  const Placement fourfold{{100, 100}, {400, 400}, {400, 400}, 0, 0};
  EXPECT_TRUE(is_fault(map_labels(annotation, fourfold, "a.txt")));
}

TEST(MapLabels, ScalesOfAThousandthAndAThousandAreExact) {
  const Placement smaller{{4000, 4000}, {4, 4}, {4, 4}, 0, 0};
  const Placement larger{{4, 4}, {4000, 4000}, {4000, 4000}, 0, 0};
  const VolumeBox small = mapped({"", {box(1000, 500, 3000, 1500)}, {}}, smaller).boxes[0];
  EXPECT_EQ(small.clipped, (Rectangle{1, 0.5, 3, 1.5}));
  const VolumeLabels large = mapped({"", {box(1, 0.5, 3, 1.5)}, {person({{{1, 2}, 1}})}}, larger);
  EXPECT_EQ(large.boxes[0].clipped, (Rectangle{1000, 500, 3000, 1500}));
  EXPECT_EQ(large.persons[0].joints[0], (Point{1499.5, 2499.5}));  // (x + 1/2) 1000 - 1/2
}

}  // namespace
}  // namespace eventgan
