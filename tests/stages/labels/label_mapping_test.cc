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

TEST(MapLabels, AnEmptyAnnotationHasNoLabels) {
  EXPECT_TRUE(mapped({}, kHalf).boxes.empty());
  EXPECT_TRUE(mapped({}, kHalf).persons.empty());
}

TEST(MapLabels, KeepsTheOrderAndMapsEachBox) {
  const auto labels = mapped({"", {box(0, 0, 1242, 375), box(621, 0, 622, 375)}, {}}, kHalf);
  ASSERT_EQ(labels.boxes.size(), 2u);
  EXPECT_EQ(labels.boxes[0].clipped, (Rectangle{0, 0, 621, 188}));
  EXPECT_EQ(labels.boxes[1].unclipped, (Rectangle{310.5, 0, 311, 188}));
  EXPECT_FALSE(labels.boxes[0].ignore);
}

TEST(MapLabels, ACropCutsABoxAndKeepsItUncut) {
  const auto labels = mapped({"", {box(400, 150, 431, 200)}, {}}, kMiddle);
  // 400 - 421 = -21, 431 - 421 = 10; 150 - 100 = 50, 200 - 100 = 100.
  EXPECT_EQ(labels.boxes[0].unclipped, (Rectangle{-21, 50, 10, 100}));
  EXPECT_EQ(labels.boxes[0].clipped, (Rectangle{0, 50, 10, 100}));
  EXPECT_FALSE(labels.boxes[0].ignore);
}

TEST(MapLabels, ABoxThatACropLeavesNothingOfStaysAndIsIgnored) {
  const auto labels = mapped({"", {box(10, 150, 40, 200), box(500, 150, 540, 200)}, {}}, kMiddle);
  ASSERT_EQ(labels.boxes.size(), 2u);
  EXPECT_TRUE(is_empty(labels.boxes[0].clipped));
  EXPECT_TRUE(labels.boxes[0].ignore);
  EXPECT_EQ(labels.boxes[0].unclipped, (Rectangle{-411, 50, -381, 100}));
  EXPECT_FALSE(labels.boxes[1].ignore);
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

TEST(MapLabels, DontCareStaysIgnored) {
  Box dont_care = box(10, 10, 20, 20);
  dont_care.ignore = true;
  EXPECT_TRUE(mapped({"", {dont_care}, {}}, kHalf).boxes[0].ignore);
}

TEST(MapLabels, ABoxToIgnoreMayLieOutsideTheImageButMustBeABox) {
  Box dont_care = box(1300, 20, 1400, 90);
  dont_care.ignore = true;
  const auto labels = mapped({"", {dont_care}, {}}, kHalf);
  ASSERT_EQ(labels.boxes.size(), 1u);
  EXPECT_TRUE(labels.boxes[0].ignore);
  EXPECT_TRUE(is_empty(labels.boxes[0].clipped));
  EXPECT_EQ(labels.boxes[0].unclipped.left, 650);  // 1300 x 621/1242
  dont_care.xyxy = {20, 10, 10, 30};
  EXPECT_THAT(fault(dont_care), HasSubstr("expected left <= right"));
  dont_care.xyxy = {kNan, 10, 20, 30};
  EXPECT_THAT(fault(dont_care), HasSubstr("expected edges within 1e6 pixels"));
}

TEST(MapLabels, BoxesAtAndSlightlyBeyondTheBorderAreFine) {
  EXPECT_EQ(fault(box(937, 197, 1241, 374)), "");
  EXPECT_EQ(fault(box(-2.5, -1, 1243, 376)), "");
  EXPECT_EQ(fault(box(100, 100, 100, 120)), "");  // no width, but inside
}

TEST(MapLabels, ABoxOutsideTheImageIsAFaultThatNamesIt) {
  const std::string reason = fault(Annotation{"", {box(0, 0, 1, 1), box(1300, 20, 1400, 90)}, {}});
  EXPECT_EQ(reason,
            "expected an overlap with the image of 1242x375 pixels, got left 1300, top 20, "
            "right 1400, bottom 90, in box 2 of 2, in label_2/001497.txt");
  EXPECT_NE(fault(box(-10, 20, 0, 90)), "");
  EXPECT_NE(fault(box(10, 375, 20, 380)), "");
  EXPECT_NE(fault(box(10, -5, 20, -1)), "");
}

TEST(MapLabels, AnInvertedBoxIsAFault) {
  EXPECT_THAT(fault(box(20, 10, 10, 30)), HasSubstr("expected left <= right"));
  EXPECT_THAT(fault(box(10, 30, 20, 10)), HasSubstr("expected left <= right and top <= bottom"));
}

TEST(MapLabels, NumbersOfABoxMustBeFinite) {
  EXPECT_THAT(fault(box(10, kNan, 20, 30)), HasSubstr("expected edges within 1e6 pixels"));
  EXPECT_NE(fault(box(10, 10, std::numeric_limits<double>::infinity(), 30)), "");
  Box one = box(10, 10, 20, 30);
  one.box3d[5] = kInfinity;
  EXPECT_EQ(fault(one),
            "expected a finite box in 3-D, got inf, in box 1 of 1, in label_2/001497.txt");
  one = box(10, 10, 20, 30);
  one.alpha = std::nanf("");
  EXPECT_THAT(fault(one), HasSubstr("finite alpha, got nan"));
  one = box(10, 10, 20, 30);
  one.truncation = static_cast<float>(1e300);
  EXPECT_THAT(fault(one), HasSubstr("finite truncation, got inf"));
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

TEST(MapLabels, APersonWithAllJointsOutsideIsAFault) {
  EXPECT_EQ(fault(person({{kMissingPoint, 0}, {{1300, 10}, 1}, {{10, 400}, 1}})),
            "expected a joint inside the image of 1242x375 pixels, got all annotated ones "
            "outside it, the first at (1300, 10), in person 1 of 1, in label_2/001497.txt");
}

TEST(MapLabels, OneJointInsideIsEnough) {
  EXPECT_EQ(fault(person({{{1300, 10}, 1}, {{1241.5, 374.5}, 0}})), "");  // the very corner
  EXPECT_NE(fault(person({{{1241.6, 10}, 1}})), "");
}

TEST(MapLabels, APersonWithoutJointsIsFineWhereverItsCentreIs) {
  EXPECT_EQ(fault(person({})), "");
  Person only_centre = person({{kMissingPoint, 0}});
  only_centre.center = {-50, 9000};
  EXPECT_EQ(fault(only_centre), "");
}

TEST(MapLabels, NumbersOfAPersonMustBeFinite) {
  const Person good = person({{{10, 10}, 1}});
  ASSERT_EQ(fault(good), "");
  Person one = good;
  one.joints.push_back({{kNan, 3}, 1});
  EXPECT_THAT(fault(one), HasSubstr("expected joints within 1e6 pixels"));
  one = good;
  one.center = {3, kNan};
  EXPECT_THAT(fault(one), HasSubstr("centre"));
  one = good;
  one.scale = kNan;
  EXPECT_THAT(fault(one), HasSubstr("scale"));
  one = good;
  one.head_box = Rectangle{0, 0, kNan, 1};
  EXPECT_THAT(fault(one), HasSubstr("head box"));
  one = good;
  one.joints3d_mm = {std::array{0.0, 0.0, 1.0}, std::array{0.0, kNan, 1.0}};
  EXPECT_THAT(fault(one), HasSubstr("expected finite joints in 3-D, got (0, nan, 1) mm"));
  one.joints3d_mm = {std::array{0.0, 0.0, 1.0}, std::nullopt};
  EXPECT_EQ(fault(one), "") << "unknown";
  one = good;
  one.camera = Intrinsics{1, 1, kNan, 1};
  EXPECT_THAT(fault(one), HasSubstr("camera"));
  one = good;
  one.distortion = LensDistortion{.k1 = -0.2, .p2 = kNan};
  EXPECT_THAT(fault(one), HasSubstr("expected a finite lens distortion, got k1 -0.2"));
}

TEST(MapLabels, PlacesLieWithinAMillionPixels) {
  const auto reason = [&](const Annotation& annotation) -> std::string {
    const auto labels = map_labels(annotation, {{100, 100}, {400, 400}, {400, 400}, 0, 0}, "a.txt");
    return is_fault(labels) ? labels.fault().reason : "";
  };
  EXPECT_EQ(reason({"", {box(1, 2, 3, 4), box(10, 10, 1e300, 20)}, {}}),
            "expected edges within 1e6 pixels, got left 10, top 10, right 1e+300, bottom 20, in "
            "box 2 of 2, in a.txt");
  EXPECT_NE(reason({"", {box(-1000001, 10, 20, 20)}, {}}), "");
  EXPECT_EQ(reason({"", {box(-1e6, -1e6, 1e6, 1e6)}, {}}), "");
  Box dont_care = box(0, 0, 1e7, 20);
  dont_care.ignore = true;
  EXPECT_NE(reason({"", {dont_care}, {}}), "");

  const Person good = person({{{10, 10}, 1}});
  Person one = good;
  one.joints.push_back({{3, -1e7}, 1});
  EXPECT_EQ(reason({"", {}, {one}}),
            "expected joints within 1e6 pixels, got (3, -1e+07), in person 1 of 1, in a.txt");
  one = good;
  one.center = {1e308, 5};
  EXPECT_THAT(reason({"", {}, {one}}), HasSubstr("a centre within 1e6 pixels, got (1e+308, 5)"));
  one = good;
  one.scale = 1e7;
  EXPECT_THAT(reason({"", {}, {one}}), HasSubstr("a scale of at most 1e6, got 1e+07"));
  one = good;
  one.head_box = Rectangle{-1e308, 0, 5, 5};
  EXPECT_THAT(reason({"", {}, {one}}), HasSubstr("a head box within 1e6 pixels, got left -1e+308"));
  one = good;
  one.camera = Intrinsics{1000, 1e308, 50, 50};
  EXPECT_THAT(reason({"", {}, {one}}), HasSubstr("a camera within 1e6 pixels, got f_x 1000"));
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
}

TEST(MapLabels, AnOutlineThatPassesACropsCornerIsIgnoredWithItsBox) {
  Box one = box(400, 60, 460, 120);  // kMiddle shows it from (421, 100) on
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

TEST(MapLabels, AnOutlineOfACornerThatIsNoPlaceIsAFault) {
  for (const double wrong : {kNan, HUGE_VAL, -1.1e6}) {
    EXPECT_THAT(fault(outlined({{{{0, 0}, {9, 0}, {9, wrong}}}})),
                HasSubstr("expected an outline within 1e6 pixels, got (9, "));
  }
  EXPECT_EQ(fault(outlined({{{{0, 0}, {9, 0}, {9, -1e6}}}})), "");
}

TEST(MapLabels, AnOutlineApartFromItsBoxIsAFault) {
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

TEST(MapLabels, ABoxWithoutAreaIsKeptAndIgnored) {
  const VolumeLabels labels = mapped({"", {box(10, 20, 10, 40), box(10, 20, 30, 20)}, {}}, kHalf);
  for (const VolumeBox& one : labels.boxes) EXPECT_TRUE(one.ignore);
  EXPECT_DOUBLE_EQ(labels.boxes[0].unclipped.left, labels.boxes[0].unclipped.right);
}

TEST(MapLabels, ABoxFarBeyondTheImageIsCutAndKeptUncut) {
  // kHalf: x / 2.
  const VolumeBox wide = mapped({"", {box(-1e6, 0, 1e6, 375)}, {}}, kHalf).boxes[0];
  EXPECT_EQ(wide.clipped, (Rectangle{0, 0, 621, 188}));
  EXPECT_EQ(wide.unclipped, (Rectangle{-5e5, 0, 5e5, 188}));
  EXPECT_FALSE(wide.ignore);
  EXPECT_THAT(fault(box(1e5, 0, 2e5, 375)), HasSubstr("expected an overlap with the image"));
}

}  // namespace
}  // namespace eventgan
