#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "manifests/values/counter_random.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "tests/stages/frames/decoding/still_image.h"

namespace eventgan {
namespace {

// Objects that move on their own: what move_still makes is held against places that are computed
// here, pixel by pixel.

/// Room for an object's soft edge, and for what is filled around where it was.
constexpr int kEdge = 2, kFilled = 4;

Rectangle shifted(const Rectangle& box, double x, double y) {
  return {box.left + x, box.top + y, box.right + x, box.bottom + y};
}

class StillObjects : public ::testing::Test {
 protected:
  /// Background of noise of 10 to 100, in each object noise of 30 levels from 120 + 40 k on.
  void draw(ImageSize size, const std::vector<Rectangle>& objects) {
    image_ = {size, std::vector<std::uint8_t>(3 * size.pixel_count())};
    const CounterRandom random = CounterRandom(5).keyed("noise");
    std::uint64_t count = 0;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        int level = 10 + static_cast<int>(random.below(count++, 91));
        for (std::size_t k = 0; k < objects.size(); ++k) {
          if (!inside(objects[k], x, y)) continue;
          level = 120 + 40 * static_cast<int>(k) + static_cast<int>(random.below(count++, 30));
        }
        set(x, y, level);
      }
    }
    boxes_.clear();
    for (const Rectangle& object : objects) boxes_.push_back(object_at(object));
    pair_.motion = ImageMotion();
    pair_.objects.assign(objects.size(), std::nullopt);
  }

  void set(int x, int y, int level) {
    for (int c = 0; c < 3; ++c) {
      image_.bgr[3 * static_cast<std::size_t>(y * image_.size.width + x) + c] =
          static_cast<std::uint8_t>(level);
    }
  }

  static int at(const ColourFrame& frame, int x, int y) {
    return frame.bgr[3 * static_cast<std::size_t>(y * frame.size.width + x)];
  }

  ColourFrame moved() const { return move_still(image_, pair_, boxes_); }

  FramesBetween frames(const ImageSpec& spec = {}) const {
    const auto image = std::make_shared<const ColourFrame>(image_);
    return MovingStill(image, pair_, spec, boxes_).frames(pair_);
  }

  /// Calls each(x, y) for every pixel of the image.
  template <class Each>
  void for_each_pixel(const Each& each) const {
    for (int y = 0; y < image_.size.height; ++y) {
      for (int x = 0; x < image_.size.width; ++x) each(x, y);
    }
  }

  ColourFrame image_;
  std::vector<Box> boxes_;
  FramePair pair_;
};

TEST_F(StillObjects, OneMovesOverABackgroundAtRestAndWhatItLeavesIsFilledFromAround) {
  const Rectangle box{30, 22, 50, 45};
  draw({60, 80}, {box});
  pair_.objects[0] = ImageMotion{.x_px = 6, .y_px = -5};
  for (const double position : {0.0, 1.0}) {
    SCOPED_TRACE(position);
    pair_.label_position = position;
    // Labelled is the previous frame: in the next one the object is farther by its motion. Labelled
    // is the next one: in the previous one it has yet to move there.
    const int dx = position == 0 ? 6 : -6, dy = position == 0 ? -5 : 5;
    const Rectangle there = shifted(box, dx, dy);
    const ColourFrame frame = moved();
    int filled = 0;
    for_each_pixel([&](int x, int y) {
      const int level = at(frame, x, y);
      if (inside(there, x, y, -kEdge)) {
        ASSERT_EQ(level, at(image_, x - dx, y - dy)) << x << ", " << y;
      } else if (!inside(there, x, y, kEdge) && !inside(box, x, y, kFilled)) {
        ASSERT_EQ(level, at(image_, x, y)) << x << ", " << y;
      } else if (!inside(there, x, y, kEdge)) {
        ASSERT_LE(level, 100) << x << ", " << y;  // of the background
        filled += inside(box, x, y);
      }
    });
    EXPECT_GT(filled, 100);
  }
}

TEST_F(StillObjects, TheNearerOneCoversAndIsTheOneThatReachesLower) {
  const Rectangle far{10, 10, 30, 40}, near{40, 15, 60, 45};
  for (const bool near_first : {false, true}) {
    SCOPED_TRACE(near_first);
    draw({60, 80}, near_first ? std::vector{near, far} : std::vector{far, near});
    const std::size_t of_near = near_first ? 0 : 1;
    pair_.label_position = 0;
    pair_.objects[of_near] = ImageMotion{.x_px = -12};
    pair_.objects[1 - of_near] = ImageMotion{.x_px = 12};
    const ColourFrame frame = moved();
    for_each_pixel([&](int x, int y) {
      if (inside(shifted(near, -12, 0), x, y, -kEdge)) {
        ASSERT_EQ(at(frame, x, y), at(image_, x + 12, y)) << x << ", " << y;
      } else if (inside(shifted(far, 12, 0), x, y, -kEdge) &&
                 !inside(shifted(near, -12, 0), x, y, kEdge)) {
        ASSERT_EQ(at(frame, x, y), at(image_, x - 12, y)) << x << ", " << y;
      }
    });
  }
}

TEST_F(StillObjects, OneAtRestHidesAFartherOneAndStaysAsItIs) {
  const Rectangle far{10, 10, 30, 40}, near{34, 15, 54, 45};
  draw({60, 80}, {far, near});
  pair_.label_position = 0;
  pair_.objects = {ImageMotion{.x_px = 14}, ImageMotion()};
  const ColourFrame frame = moved();
  for_each_pixel([&](int x, int y) {
    if (inside(near, x, y, -1)) {
      ASSERT_EQ(at(frame, x, y), at(image_, x, y)) << x << ", " << y;
    }
    if (inside(shifted(far, 14, 0), x, y, -kEdge) && !inside(near, x, y, kEdge)) {
      ASSERT_EQ(at(frame, x, y), at(image_, x - 14, y)) << x << ", " << y;
    }
  });
}

TEST_F(StillObjects, AFartherOneGoesOnBehindANearerOneThatMovesAway) {
  const Rectangle far{10, 10, 60, 40}, near{30, 20, 44, 50};
  draw({60, 80}, {far, near});  // near is drawn over far
  boxes_[0].outline = {{{{10, 10},
                         {60, 10},
                         {60, 40},
                         {44, 40},
                         {44, 20},
                         {30, 20},
                         {30, 40},
                         {10, 40}}}};  // what is seen of it
  pair_.label_position = 0;
  pair_.objects = {ImageMotion{.y_px = 0.001}, ImageMotion{.x_px = 5}};
  const ColourFrame frame = moved();
  int shown = 0;
  for_each_pixel([&](int x, int y) {
    if (!inside({30, 22, 33, 38}, x, y)) return;
    EXPECT_GE(at(frame, x, y), 115) << x << ", " << y;
    EXPECT_LE(at(frame, x, y), 155) << x << ", " << y;
    ++shown;
  });
  EXPECT_EQ(shown, 3 * 16);
}

TEST_F(StillObjects, OneThatIsHiddenAsAWholeKeepsNothingOfTheNearerOne) {
  const Rectangle box{30, 15, 60, 45};
  draw({60, 90}, {box});
  boxes_.insert(boxes_.begin(), object_at(box));  // the same object twice
  boxes_[0].xyxy.bottom -= 1;
  pair_.label_position = 0;
  pair_.objects = {ImageMotion(), ImageMotion{.x_px = 8}};
  const ColourFrame frame = moved();
  for_each_pixel([&](int x, int y) {
    if (inside(shifted(box, 8, 0), x, y, kEdge)) return;
    ASSERT_LE(at(frame, x, y), 100) << x << ", " << y;
  });
}

TEST_F(StillObjects, OneThatReachesTheBorderIsNotTornOff) {
  const Rectangle box{0, 20, 25, 60};  // at the left and the lower border
  draw({60, 80}, {box});
  pair_.label_position = 0;
  pair_.objects[0] = ImageMotion{.x_px = 9, .y_px = -7};
  const ColourFrame frame = moved();
  for_each_pixel([&](int x, int y) {
    if (!inside({0, 13, 34, 60}, x, y, -kEdge) && x > kEdge && y < 60 - kEdge) return;
    if (!inside({-9, 13 + kEdge, 34 - kEdge, 69}, x, y)) return;
    ASSERT_EQ(at(frame, x, y), at(image_, std::max(x - 9, 0), std::min(y + 7, 59)));
  });
}

/// The equation of ImageMotion about c.
Point forward(const ImageMotion& motion, Point c, Point p) {
  const double a = motion.angle_deg * std::numbers::pi / 180;
  const double x = p.x - c.x, y = p.y - c.y;
  return {c.x + motion.scale * (std::cos(a) * x - std::sin(a) * y) + motion.x_px,
          c.y + motion.scale * (std::sin(a) * x + std::cos(a) * y) + motion.y_px};
}

Point backward(const ImageMotion& motion, Point c, Point p) {
  const double a = motion.angle_deg * std::numbers::pi / 180;
  const double x = (p.x - c.x - motion.x_px) / motion.scale;
  const double y = (p.y - c.y - motion.y_px) / motion.scale;
  return {c.x + std::cos(a) * x + std::sin(a) * y, c.y - std::sin(a) * x + std::cos(a) * y};
}

TEST_F(StillObjects, AnObjectMovesAboutItsBoxBeforeTheImageDoes) {
  const Rectangle box{40, 30, 80, 70};
  const Point of_box{59.5, 49.5}, of_image{79.5, 59.5};
  draw({120, 160}, {box});
  // Levels that rise by 1 a column, and by 1 a row: cubic interpolation gives planes back.
  for_each_pixel([&](int x, int y) { set(x, y, inside(box, x, y) ? 60 + x : 20 + y); });
  pair_.motion = ImageMotion{3.3, -5.7, 1.8, 1.02};
  pair_.objects[0] = ImageMotion{-6.2, 4.1, 5, 0.95};
  for (const double position : {0.0, 1.0}) {
    SCOPED_TRACE(position);
    pair_.label_position = position;
    const ColourFrame frame = moved();
    int on_object = 0, off_object = 0;
    for_each_pixel([&](int px, int py) {
      const Point p{double(px), double(py)};
      Point object, image;  // where they lie in the labelled image
      if (position == 0) {
        image = backward(*pair_.motion, of_image, p);
        object = backward(*pair_.objects[0], of_box, image);
      } else {
        image = forward(*pair_.motion, of_image, p);
        object = forward(*pair_.motion, of_image, forward(*pair_.objects[0], of_box, p));
      }
      if (inside(box, object.x, object.y, -3)) {
        ASSERT_NEAR(at(frame, px, py), 60 + object.x, 1.1) << px << ", " << py;
        ++on_object;
      } else if (!inside(box, object.x, object.y, kEdge) &&
                 !inside(box, image.x, image.y, kFilled + 2) && image.x > 3 && image.x < 156 &&
                 image.y > 3 && image.y < 116) {
        ASSERT_NEAR(at(frame, px, py), 20 + image.y, 1.1) << px << ", " << py;
        ++off_object;
      }
    });
    EXPECT_GT(on_object, 1000);
    EXPECT_GT(off_object, 10000);
  }
}

TEST_F(StillObjects, TheLabelledImageStaysAsItIs) {
  draw({60, 80}, {{30, 22, 50, 45}});
  pair_.objects[0] = ImageMotion{4, 3, 2, 1.01};
  const ColourFrame before = image_;
  for (const double position : {0.0, 1.0}) {
    pair_.label_position = position;
    const FramesBetween between = frames();
    const auto labelled = between.at(position).pixels;
    for_each_pixel([&](int x, int y) {
      ASSERT_EQ(labelled[static_cast<std::size_t>(80 * y + x)], at(image_, x, y));
    });
    EXPECT_NE(between.at(1 - position).pixels, labelled);
  }
  EXPECT_EQ(image_.bgr, before.bgr);
}

TEST_F(StillObjects, BetweenTheFramesEverythingMovesSteadily) {
  const Rectangle box{30, 22, 50, 45};
  draw({60, 80}, {box});
  pair_.objects[0] = ImageMotion{.x_px = 8, .y_px = -4};
  for (const double position : {0.0, 1.0}) {
    SCOPED_TRACE(position);
    pair_.label_position = position;
    const FramesBetween between = frames();
    // Sampled in the volume's size: an edge's shares are rounded otherwise.
    const ColourFrame whole = moved();
    const GreyImage end = between.at(1 - position);
    for_each_pixel([&](int x, int y) {
      ASSERT_NEAR(end.pixels[static_cast<std::size_t>(80 * y + x)], at(whole, x, y), 1);
    });
    EXPECT_NEAR(between.displacement_px, std::hypot(8, 4), 1e-9);
    for (const double u : {0.0, 0.25, 0.5, 0.75, 1.0}) {
      const double share = position == 0 ? u : u - 1;  // of the motion, from the labelled image
      const int dx = static_cast<int>(8 * share), dy = static_cast<int>(-4 * share);
      const GreyImage frame = between.at(u);
      for_each_pixel([&](int x, int y) {
        const int level = frame.pixels[static_cast<std::size_t>(80 * y + x)];
        if (inside(shifted(box, dx, dy), x, y, -kEdge)) {
          ASSERT_EQ(level, at(image_, x - dx, y - dy)) << u << ": " << x << ", " << y;
        } else if (!inside(box, x, y, kFilled) && !inside(shifted(box, dx, dy), x, y, kEdge)) {
          ASSERT_EQ(level, at(image_, x, y)) << u << ": " << x << ", " << y;
        }
      });
    }
  }
  ImageSpec spec;
  spec.size = ImageSize{30, 40};
  pair_.motion = ImageMotion{.x_px = 2, .scale = 1.1};
  const FramesBetween between = frames(spec);
  EXPECT_EQ(between.at(0.3).size, (ImageSize{30, 40}));
}

TEST_F(StillObjects, BetweenTheFramesAResizedPixelIsSampledWhereItLies) {
  const Rectangle box{40, 30, 80, 70};
  const Point of_box{59.5, 49.5}, of_image{79.5, 59.5};
  draw({120, 160}, {box});
  for_each_pixel([&](int x, int y) { set(x, y, inside(box, x, y) ? 60 + x : 20 + y); });
  pair_.motion = ImageMotion{3.3, -5.7, 1.8, 1.02};
  pair_.objects[0] = ImageMotion{-6.2, 4.1, 5, 0.95};
  pair_.label_position = 0;
  ImageSpec spec;
  for (const auto& [size, grey, blur] : {std::tuple{ImageSize{55, 85}, GreyOrder::kAfterResize, 0},
                                         {ImageSize{120, 160}, GreyOrder::kBeforeResize, 0},
                                         {ImageSize{200, 300}, GreyOrder::kAfterResize, 3}}) {
    SCOPED_TRACE(to_string(size));
    spec.size = size;
    spec.grey = grey;
    spec.blur = blur;
    const FramesBetween between = frames(spec);
    const AffineMap to_source = inverse(place(image_.size, spec, pair_).source_to_volume());
    for (const double u : {0.3, 0.8}) {
      const auto part = [&](const ImageMotion& motion) {
        return ImageMotion{u * motion.x_px, u * motion.y_px, u * motion.angle_deg,
                           std::pow(motion.scale, u)};
      };
      const GreyImage frame = between.at(u);
      ASSERT_EQ(frame.size, size);
      int on_object = 0, off_object = 0;
      for (int y = 2; y < size.height - 2; ++y) {
        for (int x = 2; x < size.width - 2; ++x) {
          const Point p = mapped(to_source, {double(x), double(y)});
          const Point image = backward(part(*pair_.motion), of_image, p);
          const Point object = backward(part(*pair_.objects[0]), of_box, image);
          const int level = frame.pixels[static_cast<std::size_t>(size.width * y + x)];
          if (inside(box, object.x, object.y, -kEdge - 3)) {
            ASSERT_NEAR(level, 60 + object.x, 1.1) << u << ": " << x << ", " << y;
            ++on_object;
          } else if (!inside(box, object.x, object.y, kEdge + 3) &&
                     !inside(box, image.x, image.y, kFilled + 5)) {
            ASSERT_NEAR(level, 20 + image.y, 1.1) << u << ": " << x << ", " << y;
            ++off_object;
          }
        }
      }
      EXPECT_GT(on_object, size.height);
      EXPECT_GT(off_object, 20 * size.height);
    }
  }
}

TEST_F(StillObjects, NoPointOfAnOutlineBeyondItsBoxMovesFarther) {
  draw({60, 80}, {{30, 20, 40, 30}});
  boxes_[0].outline = outline_around({0, 20, 80, 30});
  pair_.objects[0] = ImageMotion{.angle_deg = 3};
  // About the box's middle, in pixel centres (34.5, 24.5); the farthest corner is at (79.5, 29.5).
  const double chord = 2 * std::sin(1.5 * std::numbers::pi / 180);
  EXPECT_NEAR(frames().displacement_px, chord * std::hypot(45, 5), 1e-9);
  ImageSpec stretched;
  stretched.fit = ImageFit::kStretch;
  for (const ImageSize size : {ImageSize{180, 80}, {60, 240}}) {  // three times as high, or as wide
    stretched.size = size;
    EXPECT_NEAR(frames(stretched).displacement_px, 3 * chord * std::hypot(45, 5), 1e-9);
  }
}

TEST_F(StillObjects, WhatDoesNotMoveOnItsOwnIsAPartOfTheImage) {
  const Rectangle box{30, 22, 50, 45};
  draw({60, 80}, {box});
  pair_.motion = ImageMotion{2.5, 1.5, 1, 1.01};
  const ColourFrame whole = move_still(image_, pair_);
  EXPECT_EQ(moved().bgr, whole.bgr) << "no motion of its own";
  pair_.objects[0] = ImageMotion();
  EXPECT_EQ(moved().bgr, whole.bgr) << "at rest";
  pair_.objects[0] = ImageMotion{.x_px = 4};
  boxes_[0].outline = {};
  EXPECT_EQ(moved().bgr, whole.bgr) << "no outline";
  pair_.objects.clear();
  EXPECT_EQ(moved().bgr, whole.bgr);
}

TEST_F(StillObjects, AnyOutlineWillDo) {
  pair_.label_position = 0;
  for (const ImageSize size : {ImageSize{1, 1}, {2, 3}, {1, 40}, {40, 1}, {33, 47}}) {
    const double width = size.width, height = size.height;
    for (const Rectangle& box : {Rectangle{0, 0, width, height},
                                 {-50, -50, width + 50, height + 50},
                                 {0.2, 0.2, 0.4, 0.4},
                                 {-9, -9, -2, -2},
                                 {width - 1, 0, width + 1e5, height},
                                 {-1e6, 0, 1e6, 1}}) {
      draw(size, {box});
      pair_.objects[0] = ImageMotion{.x_px = 3, .y_px = -2, .angle_deg = 40, .scale = 0.6};
      for (const ImageMotion& motion : {ImageMotion(), ImageMotion{0.1, 0.1, 1, 1.01}}) {
        pair_.motion = motion;
        EXPECT_EQ(moved().bgr.size(), image_.bgr.size()) << to_string(size);
      }
    }
  }
  // Of an object that is all there is, nothing can be filled from around it.
  draw({20, 30}, {{0, 0, 30, 20}});
  pair_.motion = ImageMotion();
  pair_.objects[0] = ImageMotion{.x_px = 3};
  const ColourFrame frame = moved();
  for_each_pixel(
      [&](int x, int y) { ASSERT_EQ(at(frame, x, y), at(image_, std::max(x - 3, 0), y)); });
}

}  // namespace
}  // namespace eventgan
