#include "stages/frames/decoding/cut_out.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <new>
#include <opencv2/core.hpp>
#include <string>
#include <thread>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/outlines.h"

namespace eventgan {
namespace {

/// Whether an object covers the pixel at (x, y).
using Shape = std::function<bool(int x, int y)>;

/// A meadow with noise, and before it an object of noisy red; or with `contrast` 0 nothing.
ColourFrame photograph(ImageSize size, const Shape& shape, int contrast = 120) {
  const CounterRandom random = CounterRandom(5).keyed("photograph");
  ColourFrame image{size, {}};
  std::uint64_t drawn = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int red = shape(x, y) ? contrast : 0;
      for (const int level : {60, 140 - red / 2, 80 + red}) {  // blue, green, red
        image.bgr.push_back(static_cast<std::uint8_t>(level + random.below(drawn++, 24)));
      }
    }
  }
  return image;
}

ColourView view(const ColourFrame& image) { return {image.size, image.bgr.data()}; }

GreyImage mask_of(const Shape& shape, ImageSize size) {
  GreyImage mask{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) mask.pixels.push_back(shape(x, y));
  }
  return mask;
}

double iou(const GreyImage& a, const GreyImage& b) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    both += a.pixels[i] && b.pixels[i];
    either += a.pixels[i] || b.pixels[i];
  }
  return both / either;
}

/// The ellipse in a box of whole pixels.
Shape ellipse_in(const Rectangle& box) {
  return [=](int x, int y) {
    const double u = (2 * x + 1 - box.left - box.right) / (box.right - box.left);
    const double v = (2 * y + 1 - box.top - box.bottom) / (box.bottom - box.top);
    return u * u + v * v <= 1;
  };
}

/// Head, arms and body in the box from (60, 40) to (140, 200).
bool figure(int x, int y) {
  const auto within = [&](int left, int top, int right, int bottom) {
    return x >= left && x < right && y >= top && y < bottom;
  };
  return within(85, 40, 115, 80) || within(60, 80, 140, 100) || within(80, 100, 120, 200);
}
constexpr Rectangle kFigureBox{60, 40, 140, 200};
constexpr ImageSize kSize{240, 200};

TEST(CutOut, FindsTheShapeInTheBox) {
  const CutOut found = cut_out(view(photograph(kSize, figure)), kFigureBox);
  EXPECT_FALSE(found.is_ellipse);
  const GreyImage truth = mask_of(figure, kSize);
  EXPECT_GT(iou(mask_of(found.outline, kSize), truth), 0.9);
  EXPECT_LT(iou(mask_of(ellipse_in(kFigureBox), kSize), truth), 0.75);
  const Rectangle around = bounds(found.outline);
  EXPECT_TRUE(around.left >= 60 && around.top >= 40 && around.right <= 140 && around.bottom <= 200);
}

/// Its narrow parts are a pixel or two of the copy.
TEST(CutOut, OfALargeImageAsOfASmallOne) {
  const ImageSize size{1200, 1000};
  const Shape large = [](int x, int y) { return figure(x / 5, y / 5); };
  const CutOut found = cut_out(view(photograph(size, large)), {300, 200, 700, 1000});
  EXPECT_FALSE(found.is_ellipse);
  EXPECT_GT(iou(mask_of(found.outline, size), mask_of(large, size)), 0.8);
}

TEST(CutOut, OfAnObjectThatTheImageCuts) {
  const Shape shifted = [](int x, int y) { return figure(x + 100, y - 30); };
  const CutOut found = cut_out(view(photograph(kSize, shifted)), {-40, 70, 40, 230});
  EXPECT_FALSE(found.is_ellipse);
  EXPECT_GT(iou(mask_of(found.outline, kSize), mask_of(shifted, kSize)), 0.8);
}

TEST(CutOut, KeepsOnePartWithoutHoles) {
  const Shape ring = [](int x, int y) {
    const double radius = std::hypot(x - 99.5, y - 99.5);
    const bool speck = x < 45 && y < 45;
    return (radius < 60 && radius > 57) || radius < 50 || (speck && x >= 40 && y >= 40);
  };
  const CutOut found = cut_out(view(photograph({200, 200}, ring)), {40, 40, 160, 160});
  EXPECT_FALSE(found.is_ellipse);
  EXPECT_EQ(found.outline.rings.size(), 1u);
  EXPECT_GE(bounds(found.outline).left + bounds(found.outline).top, 80);
  const GreyImage mask = mask_of(found.outline, {200, 200});
  EXPECT_EQ(mask.pixels[41 * 200 + 41], 0);
  EXPECT_EQ(mask.pixels[100 * 200 + 100], 1);
}

TEST(CutOut, KeepsThePartInTheMiddle) {
  const Shape pole = [](int x, int y) { return x >= 17 && x < 25 && y >= 9 && y < 47; };
  const Shape beside = [](int x, int y) { return x >= 28 && x < 40 && y >= 8 && y < 48; };
  const ImageSize size{66, 50};
  const ColourFrame image =
      photograph(size, [&](int x, int y) { return pole(x, y) || beside(x, y); });
  const CutOut found = cut_out(view(image), {8, 8, 34, 48});
  EXPECT_FALSE(found.is_ellipse);
  EXPECT_GT(iou(mask_of(found.outline, size), mask_of(pole, size)), 0.7);
  EXPECT_EQ(iou(mask_of(found.outline, size), mask_of(beside, size)), 0);
}

/// Has no memory.
class FullAllocator final : public cv::MatAllocator {
 public:
  cv::UMatData* allocate(int, const int*, int, void*, std::size_t*, cv::AccessFlag,
                         cv::UMatUsageFlags) const override {
    throw cv::Exception(cv::Error::StsNoMem, "no memory", "", "", 0);
  }
  bool allocate(cv::UMatData*, cv::AccessFlag, cv::UMatUsageFlags) const override { return false; }
  void deallocate(cv::UMatData*) const override {}
};

TEST(CutOut, LackOfMemoryMakesNoEllipse) {
  const ColourFrame image = photograph(kSize, figure);
  FullAllocator full;
  cv::MatAllocator* const usual = cv::Mat::getDefaultAllocator();
  cv::Mat::setDefaultAllocator(&full);
  EXPECT_THROW(cut_out(view(image), kFigureBox), std::bad_alloc);
  cv::Mat::setDefaultAllocator(usual);
}

TEST(CutOut, WhatCannotBeCutIsTheEllipseInTheBox) {
  const ColourFrame image = photograph(kSize, figure);
  struct Case {
    const char* what;
    Rectangle box;
    Rectangle part;  ///< of the image
  };
  for (const Case& c : {Case{"narrow", {90, 40, 105, 200}, {90, 40, 105, 200}},
                        Case{"low", {60, 90, 140, 93}, {60, 90, 140, 93}},
                        Case{"a pixel", {7, 9, 8, 10}, {7, 9, 8, 10}},
                        Case{"part of a pixel", {7.2, 9.3, 7.7, 9.6}, {7, 9, 8, 10}},
                        Case{"the whole image", {0, 0, 200, 240}, {0, 0, 200, 240}},
                        Case{"more than the image", {-50, -1e9, 1e300, 500}, {0, 0, 200, 240}},
                        Case{"a corner reaches in", {190, 230, 400, 400}, {190, 230, 200, 240}}}) {
    SCOPED_TRACE(c.what);
    const CutOut found = cut_out(view(image), c.box);
    EXPECT_TRUE(found.is_ellipse);
    EXPECT_EQ(mask_of(found.outline, kSize), mask_of(ellipse_in(c.part), kSize));
  }
  const ColourFrame dot = photograph({1, 1}, figure);
  EXPECT_EQ(mask_of(cut_out(view(dot), {0, 0, 1, 1}).outline, {1, 1}).pixels[0], 1);
}

TEST(CutOut, WhatDoesNotStandOutIsCutSomehowOrAnEllipse) {
  const ColourFrame even{kSize, std::vector<std::uint8_t>(3 * kSize.pixel_count(), 90)};
  const CutOut of_even = cut_out(view(even), kFigureBox);
  EXPECT_TRUE(of_even.is_ellipse);
  const CutOut of_noise = cut_out(view(photograph(kSize, figure, 0)), kFigureBox);
  EXPECT_FALSE(of_noise.outline.empty());
  // All of the box differs from what is around it.
  const Shape board = [](int x, int y) { return x >= 60 && x < 140 && y >= 40 && y < 200; };
  EXPECT_TRUE(cut_out(view(photograph(kSize, board)), kFigureBox).is_ellipse);
}

TEST(CutOut, NoOutlineOfWhatHoldsNoPixel) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const ColourFrame image = photograph(kSize, figure);
  for (const Rectangle& box : {Rectangle{0, 0, 0, 0},
                               {50, 50, 50, 90},
                               {90, 90, 50, 50},
                               {kNan, 0, 10, 10},
                               {0, 0, 10, kNan},
                               {-90, 0, -10, 90},
                               {200, 0, 300, 100},
                               {7.6, 9, 8.4, 10}}) {
    EXPECT_TRUE(cut_out(view(image), box).outline.empty());
  }
}

TEST(CutOut, IsTheSameInWhateverThreadAndAfterWhateverElse) {
  const ColourFrame image = photograph(kSize, figure, 40);
  const auto box = [](int i) { return Rectangle{60.0 - i, 40.0 - 2 * i, 140.0 + i, 200.0 - i}; };
  std::vector<Outline> alone;
  for (int i = 0; i < 16; ++i) alone.push_back(cut_out(view(image), box(i)).outline);
  std::vector<Outline> beside(16);
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&, thread] {
      cv::Mat drawn(1, 100 + thread, CV_8U);
      cv::randu(drawn, 0, 255);
      for (int i = 15 - thread; i >= 0; i -= 8)
        beside[std::size_t(i)] = cut_out(view(image), box(i)).outline;
    });
  }
  threads.clear();
  EXPECT_EQ(beside, alone);
}

TEST(CutOutMissing, LeavesWhatIsThereAndWhatIsToBeIgnored) {
  const Outline own{{{{1, 1}, {3, 1}, {3, 3}}}};
  std::vector<Box> boxes{{.xyxy = kFigureBox, .outline = own},
                         {.xyxy = kFigureBox},
                         {.xyxy = kFigureBox, .ignore = true},
                         {.xyxy = {5, 5, 9, 9}},
                         {.xyxy = {-9, -9, -5, -5}}};
  const ColourFrame image = photograph(kSize, figure);
  OutlineCounts counts = cut_out_missing(view(image), boxes);
  EXPECT_EQ(boxes[0].outline, own);
  EXPECT_EQ(boxes[1].outline, cut_out(view(image), kFigureBox).outline);
  EXPECT_TRUE(boxes[2].outline.empty());
  EXPECT_EQ(bounds(boxes[3].outline), boxes[3].xyxy);
  EXPECT_TRUE(boxes[4].outline.empty());
  counts += counts;
  EXPECT_EQ(to_text(counts), "2 of labels, 2 cut out of their boxes, 2 ellipses");
}

}  // namespace
}  // namespace eventgan
