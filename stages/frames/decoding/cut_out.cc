#include "stages/frames/decoding/cut_out.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "manifests/values/outlines.h"

namespace eventgan {
namespace {

constexpr double kSurroundings = 0.1;  // around the box, of its sides
constexpr int kLeastSurroundings_px = 4;
constexpr int kLeastSide_px = 16;  // below, an ellipse is as good
constexpr int kLeastPixels = 5;    // of object and background: GrabCut tells apart so many colours
constexpr double kLeastCut = 0.1;  // of what lies in the box beside the core, the share that is
constexpr double kMostCut = 0.95;  // cut, in pixels of the copy
constexpr double kCoreHeight = 0.9;        // of the box's
constexpr double kCoreWidths[]{0.3, 0.9};  // least and most, of the box's

/// The pixels whose centres lie in the box and the image; empty also of a box that is none.
cv::Rect pixels_of(const Rectangle& box, ImageSize size) {
  const auto first = [](double edge, int end) {
    return static_cast<int>(std::clamp(std::ceil(edge - 0.5), 0.0, double(end)));
  };
  if (!(box.left < box.right && box.top < box.bottom)) return {};
  const int x = first(box.left, size.width), y = first(box.top, size.height);
  return {x, y, first(box.right, size.width) - x, first(box.bottom, size.height) - y};
}

/// `inner` with its surroundings, as far as the image goes.
cv::Rect with_margin(const cv::Rect& inner, ImageSize size) {
  const auto margin = [](int side) {
    return std::max(kLeastSurroundings_px, static_cast<int>(std::lround(kSurroundings * side)));
  };
  const int dx = margin(inner.width), dy = margin(inner.height);
  return cv::Rect(inner.x - dx, inner.y - dy, inner.width + 2 * dx, inner.height + 2 * dy) &
         cv::Rect(0, 0, size.width, size.height);
}

/// Sets `value` where a pixel's centre lies in the ellipse in the middle of `box`, whose sides are
/// these shares of the box's.
void fill_ellipse(cv::Mat& mask, const cv::Rect2d& box, double width, double height,
                  std::uint8_t value) {
  const double radius_x = width * box.width / 2, radius_y = height * box.height / 2;
  for (int y = 0; y < mask.rows; ++y) {
    const double v = (y + 0.5 - box.y - box.height / 2) / radius_y;
    for (int x = 0; x < mask.cols; ++x) {
      const double u = (x + 0.5 - box.x - box.width / 2) / radius_x;
      if (u * u + v * v <= 1) mask.at<std::uint8_t>(y, x) = value;
    }
  }
}

/// 255 where the part of a mask is that holds `place`, or a hole in it, which the mask's border
/// does not reach.
cv::Mat part_at(const cv::Mat& mask, cv::Point place) {
  cv::Mat parts;
  cv::connectedComponents(mask, parts, 4, CV_32S);
  cv::Mat around;
  cv::copyMakeBorder(parts != parts.at<int>(place), around, 1, 1, 1, 1, cv::BORDER_CONSTANT,
                     cv::Scalar(255));
  cv::floodFill(around, {0, 0}, cv::Scalar(128));
  return around(cv::Rect(1, 1, mask.cols, mask.rows)) != 128;
}

/// The mask, 0 or 255, of the object in `inner`, a part of `image`; none if it was cut badly.
std::optional<cv::Mat> cut(const cv::Mat& image, const cv::Rect& inner, const CutOutSpec& spec) {
  const cv::Rect outer = with_margin(inner, {image.rows, image.cols});
  if (std::min(inner.width, inner.height) < kLeastSide_px || outer == inner) return std::nullopt;
  const double scale = std::min(1.0, double(spec.side_px) / std::max(inner.width, inner.height));
  const auto scaled = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(scale * side)));
  };
  cv::Mat copy;
  cv::resize(image(outer), copy, cv::Size(scaled(outer.width), scaled(outer.height)), 0, 0,
             cv::INTER_AREA);
  const double scale_x = double(copy.cols) / outer.width,
               scale_y = double(copy.rows) / outer.height;
  const cv::Rect2d box(scale_x * (inner.x - outer.x), scale_y * (inner.y - outer.y),
                       scale_x * inner.width, scale_y * inner.height);

  cv::Mat labels(copy.size(), CV_8U, cv::Scalar(cv::GC_BGD));
  const cv::Rect open =
      pixels_of({box.x, box.y, box.x + box.width, box.y + box.height}, {copy.rows, copy.cols});
  labels(open).setTo(cv::GC_PR_FGD);
  fill_ellipse(labels, box,
               std::clamp(spec.core * inner.width / inner.height, kCoreWidths[0], kCoreWidths[1]),
               kCoreHeight, cv::GC_FGD);
  const int core = cv::countNonZero(labels == cv::GC_FGD);
  const int background_count = cv::countNonZero(labels == cv::GC_BGD);
  if (std::min(background_count, open.area()) < kLeastPixels) return std::nullopt;

  cv::theRNG() = cv::RNG(1);
  cv::Mat background, foreground;
  cv::grabCut(copy, labels, {}, background, foreground, spec.iterations, cv::GC_INIT_WITH_MASK);
  const cv::Mat found = labels & 1;  // GC_FGD and GC_PR_FGD are odd
  const cv::Point middle(static_cast<int>(box.x + box.width / 2),
                         static_cast<int>(box.y + box.height / 2));
  if (found.at<std::uint8_t>(middle) == 0) return std::nullopt;
  const cv::Mat object = part_at(found, middle);
  const double cut_open = double(cv::countNonZero(object(open)) - core) / (open.area() - core);
  if (!(cut_open >= kLeastCut && cut_open <= kMostCut)) return std::nullopt;
  cv::Mat full;
  cv::resize(object, full, outer.size(), 0, 0, cv::INTER_LINEAR);
  return full(inner - outer.tl()) >= 128;
}

}  // namespace

CutOut cut_out(const ColourView& image, const Rectangle& box, const CutOutSpec& spec) {
  const cv::Rect inner = pixels_of(box, image.size);
  if (inner.empty()) return {};
  CutOut result;
  std::optional<cv::Mat> mask;
  try {
    mask = cut({image.size.height, image.size.width, CV_8UC3, const_cast<std::uint8_t*>(image.bgr)},
               inner, spec);
  } catch (const cv::Exception& exception) {
    if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();
    throw std::runtime_error("expected an object that can be cut out, got " + exception.err);
  }
  result.is_ellipse = !mask;
  if (result.is_ellipse) {
    mask.emplace(inner.size(), CV_8U, cv::Scalar(0));
    fill_ellipse(*mask, {0, 0, double(inner.width), double(inner.height)}, 1, 1, 255);
  }
  GreyImage grey{{inner.height, inner.width}, {}};
  grey.pixels.reserve(grey.size.pixel_count());
  for (int y = 0; y < mask->rows; ++y) {
    grey.pixels.insert(grey.pixels.end(), mask->ptr(y), mask->ptr(y) + mask->cols);
  }
  result.outline = outline_of(grey);
  for (std::vector<Point>& ring : result.outline.rings) {
    for (Point& corner : ring) corner = {corner.x + inner.x, corner.y + inner.y};
  }
  return result;
}

OutlineCounts cut_out_missing(const ColourView& image, std::vector<Box>& boxes) {
  OutlineCounts counts;
  for (Box& box : boxes) {
    if (box.ignore) continue;
    if (!box.outline.empty()) {
      ++counts.given;
      continue;
    }
    CutOut found = cut_out(image, box.xyxy);
    if (found.outline.empty()) continue;
    ++(found.is_ellipse ? counts.ellipses : counts.cut);
    box.outline = std::move(found.outline);
  }
  return counts;
}

}  // namespace eventgan
