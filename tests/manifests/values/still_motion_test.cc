#include "manifests/values/still_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr double kNear = 1e-9;

void expect_near(Point a, Point b) {
  EXPECT_NEAR(a.x, b.x, kNear);
  EXPECT_NEAR(a.y, b.y, kNear);
}

TEST(StillMotion, IsItsEquationAndStartsAtRest) {
  const ImageMotion motion{4, -2, 30, 1.21};
  const Point centre{10, 20};
  // 10 right of the centre: turned by 30 degrees towards y, 1.21 as far away, and shifted.
  const double angle = std::numbers::pi / 6;
  expect_near(mapped(map_of(motion, centre), {20, 20}),
              {14 + 12.1 * std::cos(angle), 18 + 12.1 * std::sin(angle)});
  expect_near(mapped(map_of(motion, centre, 0.5), {20, 20}),
              {12 + 11 * std::cos(angle / 2), 19 + 11 * std::sin(angle / 2)});
  expect_near(mapped(map_of(motion, centre, 0), {3, 7}), {3, 7});
}

TEST(StillMotion, MapsAreComposedAndInverted) {
  const AffineMap a = map_of({4, -2, 30, 1.2}, {10, 20}), b = map_of({1, 1, -70, 0.5}, {0, 3});
  for (const Point p : {Point{0, 0}, {100, -3}, {7, 55}}) {
    expect_near(mapped(compose(a, b), p), mapped(a, mapped(b, p)));
    expect_near(mapped(inverse(a), mapped(a, p)), p);
  }
  EXPECT_THROWS(inverse({1, 2, 0, 2, 4, 0}), std::invalid_argument,
                "expected a map that has an inverse");
}

TEST(StillMotion, LeadsToTheLabelledImage) {
  const ImageSize size{60, 80};
  const Point middle{39.5, 29.5}, of_box{19.5, 24.5};
  const Box box{.class_id = 0, .xyxy = {10, 20, 30, 30}};
  FramePair pair;
  pair.motion = ImageMotion{4, -2, 10, 1.1};
  const ImageMotion object{-3, 5, -20, 0.9};
  const auto seen_at = [&](Point previous, double u, bool is_object) {
    if (is_object) previous = mapped(map_of(object, of_box, u), previous);
    return mapped(map_of(*pair.motion, middle, u), previous);
  };
  for (const double position : {0.0, 1.0}) {
    pair.label_position = position;
    for (const double u : {0.0, 0.3, 1.0}) {
      const Point p{17, 33};  // of the previous frame
      expect_near(mapped(image_to_labelled(size, pair, u), seen_at(p, u, false)),
                  seen_at(p, position, false));
      expect_near(mapped(object_to_labelled(size, pair, object, box, u), seen_at(p, u, true)),
                  seen_at(p, position, true));
    }
  }
}

Box outlined(Rectangle box = {1, 1, 3, 3}) {
  return {.class_id = 0, .xyxy = box, .outline = {{{{1, 1}, {3, 1}, {3, 3}}}}};
}

class SettleMotion : public ::testing::Test {
 protected:
  SettleMotion() { spec_.stills = StillsSpec{.objects = ObjectMotionSpec()}; }

  /// The pair of sample number i, as it is planned and with these boxes.
  FramePair settled(int i, const std::vector<Box>& boxes,
                    std::optional<ImageSize> image = std::nullopt) {
    const std::string id = std::to_string(i);
    const PairKey key{7, "frames", id};
    FramePair pair;
    pair.motion = draw_motion(*spec_.stills, key.pair());
    settle_motion(spec_, key, boxes, std::nullopt, pair);
    if (image) settle_motion(spec_, key, boxes, image, pair);
    return pair;
  }

  static bool rests(const std::optional<ImageMotion>& motion) { return motion == ImageMotion(); }

  PairSpec spec_;
};

TEST_F(SettleMotion, ObjectsAreDrawnWithinTheirLimitsAndFillThem) {
  std::array<double, 2> lengths{99, 0}, angles{99, -99}, scales{99, 0};
  int images_at_rest = 0, resting = 0, moving = 0;
  for (int i = 0; i < 1000; ++i) {
    const FramePair pair = settled(i, {outlined(), outlined()});
    const bool image_rests = rests(pair.motion);
    images_at_rest += image_rests;
    ASSERT_EQ(pair.objects.size(), 2u);
    EXPECT_TRUE(pair.objects[0] != pair.objects[1] || rests(pair.objects[0]));
    for (const auto& motion : pair.objects) {
      if (rests(motion)) {
        EXPECT_FALSE(image_rests) << "a sensor would see nothing";
        ++resting;
        continue;
      }
      moving += !image_rests;
      const auto take = [](std::array<double, 2>& range, double value) {
        range = {std::min(range[0], value), std::max(range[1], value)};
      };
      take(lengths, std::hypot(motion->x_px, motion->y_px));
      take(angles, motion->angle_deg);
      take(scales, motion->scale);
    }
  }
  const auto expect_fills = [](const std::array<double, 2>& range, double least, double most) {
    EXPECT_GE(range[0], least - kNear);
    EXPECT_LE(range[1], most + kNear);
    EXPECT_GT(range[1] - range[0], 0.98 * (most - least));
  };
  expect_fills(lengths, 0, 8);
  expect_fills(angles, -3, 3);
  expect_fills(scales, 0.96, 1.04);
  EXPECT_NEAR(images_at_rest, 500, 64);  // four standard deviations, here and below
  EXPECT_NEAR(resting, 0.2 * (resting + moving), 4 * std::sqrt(0.16 * (resting + moving)));
}

TEST_F(SettleMotion, WhatHasAnOutlineOrCanBeCutOutAndCountsMovesOnItsOwn) {
  Box ignored = outlined();
  ignored.ignore = true;
  const Box plain{.class_id = 0, .xyxy = {1, 1, 3, 3}}, empty{.class_id = 0, .xyxy = {1, 1, 1, 3}};
  const std::vector<Box> boxes{empty, outlined(), ignored, plain};
  for (int i = 0; i < 50; ++i) {
    const FramePair pair = settled(i, boxes);
    ASSERT_EQ(pair.objects.size(), 4u);
    EXPECT_TRUE(pair.objects[3]);
    EXPECT_FALSE(pair.objects[0]);
    EXPECT_TRUE(pair.objects[1]);
    EXPECT_FALSE(pair.objects[2]);
    // Its number decides, whatever the others are.
    EXPECT_EQ(settled(i, {outlined(), outlined(), outlined()}).objects[1], pair.objects[1]);
  }
}

TEST_F(SettleMotion, AnImageBeforeWhichNothingMovesDoesNotRest) {
  StillsSpec always = *spec_.stills;
  always.rests = 0;
  const StillsSpec usual = *spec_.stills;
  std::set<bool> planned_at_rest;
  for (int i = 0; i < 50; ++i) {
    const std::string id = std::to_string(i);
    const ImageMotion moving = draw_motion(always, PairKey{7, "frames", id}.pair());
    planned_at_rest.insert(rests(draw_motion(usual, PairKey{7, "frames", id}.pair())));
    for (const std::vector<Box>& boxes : {std::vector<Box>(), std::vector<Box>(1)}) {
      const FramePair pair = settled(i, boxes);
      EXPECT_EQ(pair.motion, moving);
      EXPECT_TRUE(pair.objects.empty());
    }
    // To rest or not changes no other draw.
    const FramePair pair = settled(i, {outlined()});
    EXPECT_TRUE(rests(pair.motion) || pair.motion == moving);
  }
  EXPECT_EQ(planned_at_rest.size(), 2u);
}

TEST_F(SettleMotion, WhatTheImageHasNoPixelOfDoesNotMove) {
  const ImageSize image{9, 12};
  const Box outside{.class_id = 0, .xyxy = {-90, 0, -10, 90}};
  const Box between{.class_id = 0, .xyxy = {7.6, 2, 8.4, 3}};
  Box outline_outside = outlined();
  for (Point& corner : outline_outside.outline.rings[0]) corner.x += 12;
  Box sliver = outlined();  // which passes between the pixels' centres
  sliver.outline = {{{{2, 2}, {8, 5}, {8, 5.05}}}};
  Box reaches_in = outside;
  reaches_in.xyxy.right = 1;
  for (int i = 0; i < 50; ++i) {
    for (const Box& box : {outside, between, outline_outside, sliver}) {
      const FramePair pair = settled(i, {box}, image);
      EXPECT_FALSE(rests(pair.motion));
      EXPECT_TRUE(pair.objects.empty());
      EXPECT_FALSE(settled(i, {box, outlined()}, image).objects.at(0));
    }
    const FramePair pair = settled(i, {reaches_in}, image);
    EXPECT_TRUE(pair.objects.at(0));
    EXPECT_EQ(pair.motion, settled(i, {reaches_in}).motion);
  }
}

TEST_F(SettleMotion, SharesAreThoseOfTheManifest) {
  spec_.stills->rests = 1;
  spec_.stills->objects->rests = 1;
  for (int i = 0; i < 20; ++i) {
    const FramePair pair = settled(i, {outlined()});
    EXPECT_TRUE(rests(pair.motion));
    EXPECT_FALSE(rests(pair.objects.at(0)));
  }
  spec_.stills->rests = 0;
  for (int i = 0; i < 20; ++i) {
    const FramePair pair = settled(i, {outlined()});
    EXPECT_FALSE(rests(pair.motion));
    EXPECT_TRUE(rests(pair.objects.at(0)));
  }
  spec_.stills->objects.reset();
  spec_.stills->rests.reset();
  for (int i = 0; i < 20; ++i) {
    const FramePair pair = settled(i, {outlined()});
    EXPECT_FALSE(rests(pair.motion));
    EXPECT_TRUE(pair.objects.empty());
  }
}

TEST_F(SettleMotion, PairsOfSequencesStayAsTheyAre) {
  spec_.stills.reset();
  FramePair pair;
  settle_motion(spec_, {7, "frames", "1"}, {outlined()}, ImageSize{4, 4}, pair);
  EXPECT_FALSE(pair.motion);
  EXPECT_TRUE(pair.objects.empty());
}

Box outlined(int class_id, const Rectangle& box) {
  return {.class_id = class_id,
          .xyxy = box,
          .outline = {{{{box.left, box.top},
                        {box.right, box.top},
                        {box.right, box.bottom},
                        {box.left, box.bottom}}}}};
}

/// Poses of a clip of 100 frames of an image of 640x480.
std::vector<StillPose> poses_of(const std::vector<Box>& boxes, std::uint64_t seed) {
  StillsSpec spec;
  spec.objects = ObjectMotionSpec{{6, 8}, 3, 0.04, 0};
  return clip_poses(spec, CounterRandom(seed), boxes, carriers(boxes), {480, 640}, 100);
}

TEST(ClipPoses, ARiderGoesWithHisHorse) {
  // A rider, half in the box of the horse; his hat, in his; one beside him, and another horse in
  // the first one's box.
  const std::vector<Box> boxes = {
      outlined(0, {200, 150, 260, 260}), outlined(1, {150, 200, 350, 400}),
      outlined(2, {220, 145, 240, 165}), outlined(0, {340, 150, 400, 260}),
      outlined(1, {120, 210, 220, 300})};
  int apart = 0, together = 0;
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    for (const StillPose& pose : poses_of(boxes, seed)) {
      const auto map = [&](std::size_t k) {
        return object_in_clip({480, 640}, pose, pose.objects[k].value(), boxes[k]);
      };
      for (const Point corner : {Point{150, 150}, {350, 400}}) {
        const Point of_horse = mapped(map(1), corner);
        for (const std::size_t k : {0u, 2u}) {
          const Point carried = mapped(map(k), corner);
          EXPECT_NEAR(carried.x, of_horse.x, 1e-6);
          EXPECT_NEAR(carried.y, of_horse.y, 1e-6);
        }
        ++together;
        for (const std::size_t k : {3u, 4u}) {
          const Point other = mapped(map(k), corner);
          apart += std::hypot(other.x - of_horse.x, other.y - of_horse.y) > 2;
        }
      }
    }
  }
  EXPECT_GT(apart, 1.5 * together);
}

TEST(Carriers, AreLargerAndHoldHalfOfABox) {
  using ::testing::ElementsAre;
  EXPECT_TRUE(carriers({}).empty());
  const Box large = outlined(0, {0, 0, 100, 100});
  EXPECT_THAT(carriers({large, outlined(1, {50, 30, 70, 70}), outlined(1, {90, 0, 110, 40}),
                        outlined(1, {91, 0, 111, 40})}),
              ElementsAre(0, 0, 0, 3));
  Box ignored = large, without = large;
  ignored.ignore = true;
  without.outline = {};
  EXPECT_THAT(carriers({ignored, without, outlined(1, {50, 30, 70, 70})}), ElementsAre(0, 1, 2));
  EXPECT_THAT(carriers({large, outlined(1, {50, 50, 50, 90})}), ElementsAre(0, 1)) << "no area";
}

TEST(Carriers, OfOneClassCoverHalfOfAnOutline) {
  using ::testing::ElementsAre;
  const Box large = outlined(0, {0, 0, 100, 100}), inner = outlined(0, {50, 50, 70, 90});
  EXPECT_THAT(
      carriers({large, inner, outlined(0, {92, 0, 112, 40}), outlined(0, {0, 0, 100, 100})}),
      ElementsAre(0, 0, 2, 3));
  EXPECT_THAT(carriers({large, outlined(0, {81, 0, 101, 40}), outlined(0, {83, 50, 103, 90})}),
              ElementsAre(0, 0, 2))
      << "nine tenths of the box";
  // Somebody in a crowd, in the box of one who is nearer; and two that were cut out as one.
  Box nearer = large;
  nearer.outline = outlined(0, {0, 0, 59, 100}).outline;
  EXPECT_THAT(carriers({nearer, inner}), ElementsAre(0, 1));
  nearer.outline = outlined(0, {0, 0, 61, 100}).outline;
  EXPECT_THAT(carriers({nearer, inner}), ElementsAre(0, 0));
  // A hole, which runs the other way, is not covered; what lies in two parts is.
  nearer.outline.rings = {{{0, 0}, {100, 0}, {100, 100}, {0, 100}},
                          {{45, 45}, {45, 95}, {75, 95}, {75, 45}}};
  EXPECT_THAT(carriers({nearer, inner}), ElementsAre(0, 1));
  std::ranges::reverse(nearer.outline.rings[1]);
  EXPECT_THAT(carriers({nearer, inner}), ElementsAre(0, 0));
  Box thin = inner;  // its outline covers nothing
  thin.outline = {{{{50, 50}, {70, 50}, {60, 50}}}};
  EXPECT_THAT(carriers({large, thin}), ElementsAre(0, 1));
}

TEST(Carriers, AreNotWhatSomebodyStandsBefore) {
  using ::testing::ElementsAre;
  const auto goes_with_the_bus = [](const Rectangle& box) {
    return carriers({outlined(0, {100, 100, 500, 300}), outlined(1, box)})[1] == 0;
  };
  EXPECT_FALSE(goes_with_the_bus({200, 180, 250, 305})) << "who waits for it";
  EXPECT_FALSE(goes_with_the_bus({200, 180, 250, 271}));
  EXPECT_TRUE(goes_with_the_bus({200, 180, 250, 269})) << "a passenger";
  EXPECT_FALSE(goes_with_the_bus({200, 180, 319, 299}));
  EXPECT_TRUE(goes_with_the_bus({200, 180, 321, 299})) << "not narrow";
  const Box rider = outlined(1, {120, 20, 260, 300}), bicycle = outlined(2, {110, 160, 270, 310});
  EXPECT_THAT(carriers({bicycle, rider}), ElementsAre(1, 1));
}

TEST(ClipPoses, AnObjectThatIsFarFromItsPlaceTurnsBack) {
  const double radius = 0.3 * 480;  // of the image's shorter side
  // From there it turns by 0.5 rad a frame, less the 0.15 that it may turn the other way: half
  // round on a circle of a step of 8 px by 0.35 rad.
  const double farthest = radius + 2 * 8 / 0.35;
  int beyond = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    for (const StillPose& pose : poses_of({outlined(0, {200, 150, 300, 250})}, seed)) {
      const double away_px = std::hypot(pose.objects[0]->x_px, pose.objects[0]->y_px);
      EXPECT_LE(away_px, farthest);
      beyond += away_px > radius;
    }
  }
  EXPECT_GT(beyond, 20);
}

TEST(ClipPoses, WhatHoldsNoPixelDoesNotMove) {
  Box sliver = outlined(0, {20, 20, 80, 50});
  sliver.outline = {{{{20, 20}, {80, 50}, {80, 50.05}}}};
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    const auto alone = poses_of({sliver}, seed);
    EXPECT_TRUE(alone.back().objects.empty());
    EXPECT_NE(alone.back().image, ImageMotion()) << "there would be no events";
    const auto beside = poses_of({sliver, outlined(0, {100, 100, 200, 300})}, seed);
    EXPECT_FALSE(beside.back().objects.at(0));
    EXPECT_TRUE(beside.back().objects.at(1));
  }
}

TEST(ClipPoses, WhatLooksSmallMovesSlowly) {
  const std::vector<Box> boxes = {outlined(0, {300, 200, 308, 218}),   // 12 px
                                  outlined(0, {100, 100, 200, 300})};  // 141 px
  double small = 0, large = 0;
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    const auto poses = poses_of(boxes, seed);
    for (std::size_t i = 1; i < poses.size(); ++i) {
      const auto step = [&](std::size_t k) {
        const ImageMotion &a = *poses[i - 1].objects[k], &b = *poses[i].objects[k];
        return std::hypot(b.x_px - a.x_px, b.y_px - a.y_px);
      };
      small = std::max(small, step(0));
      large = std::max(large, step(1));
    }
  }
  EXPECT_NEAR(small, 3, 1e-6);
  EXPECT_GE(large, 6);
  EXPECT_LE(large, 8 + 1e-6);
}

}  // namespace
}  // namespace eventgan
