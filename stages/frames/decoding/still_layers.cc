#include "stages/frames/decoding/detail/still_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "manifests/values/outlines.h"

namespace eventgan {
namespace {

constexpr int kRoom_px = 2;    // around a mask: what its edge and sampling reach
constexpr int kMargin_px = 1;  // of an object's own light, which its outline leaves out
constexpr double kSlack_px = 2;

cv::Rect whole(const cv::Mat& image) { return {0, 0, image.cols, image.rows}; }

/// The pixels that a rectangle touches, and `room` around them.
cv::Rect pixels_of(const Rectangle& box, int room, const cv::Rect& image) {
  const auto inside = [&](double edge) { return static_cast<int>(std::clamp(edge, -1e6, 1e6)); };
  const int left = inside(std::floor(box.left)) - room, top = inside(std::floor(box.top)) - room;
  const int right = inside(std::ceil(box.right)) + room;
  const int bottom = inside(std::ceil(box.bottom)) + room;
  return cv::Rect(left, top, right - left, bottom - top) & image;
}

GreyImage mask_within(const Outline& outline, const cv::Rect& area) {
  Outline moved = outline;
  for (auto& ring : moved.rings) {
    for (Point& corner : ring) corner = {corner.x - area.x, corner.y - area.y};
  }
  return mask_of(moved, {area.height, area.width});
}

/// Gives each `wanted` pixel of `picture` that of `known` which is its mirror image at the nearest
/// known pixel, or this one if there is none. All have one size; wanted ones are not known.
void continue_into(cv::Mat& picture, const cv::Mat& known, const cv::Mat& wanted) {
  cv::Mat distance, labels;
  cv::distanceTransform(known == 0, distance, labels, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  std::vector<cv::Point> places;  // of known pixels, by label
  for (int y = 0; y < known.rows; ++y) {
    for (int x = 0; x < known.cols; ++x) {
      if (known.at<std::uint8_t>(y, x) == 0) continue;
      const auto label = static_cast<std::size_t>(labels.at<int>(y, x));
      if (places.size() <= label) places.resize(label + 1);
      places[label] = {x, y};
    }
  }
  if (places.empty()) return;
  const auto bytes = static_cast<std::size_t>(picture.channels());
  for (int y = 0; y < wanted.rows; ++y) {
    for (int x = 0; x < wanted.cols; ++x) {
      if (wanted.at<std::uint8_t>(y, x) == 0) continue;
      const cv::Point nearest = places[static_cast<std::size_t>(labels.at<int>(y, x))];
      cv::Point from = 2 * nearest - cv::Point(x, y);
      if (!whole(known).contains(from) || known.at<std::uint8_t>(from) == 0) from = nearest;
      std::copy_n(picture.ptr(from.y) + bytes * static_cast<std::size_t>(from.x), bytes,
                  picture.ptr(y) + bytes * static_cast<std::size_t>(x));
    }
  }
}

bool is_identity(const AffineMap& map) {
  constexpr AffineMap kIdentity{1, 0, 0, 0, 1, 0};
  constexpr double kRounding = 1e-9;
  return std::ranges::equal(map, kIdentity,
                            [](double a, double b) { return std::abs(a - b) < kRounding; });
}

/// The part `to` of the frame, sampled where `map` leads: `image` is the part of the source that
/// begins at `from`.
cv::Mat sampled(const cv::Mat& image, cv::Point from, AffineMap map, const cv::Rect& to,
                int interpolation) {
  map[2] += map[0] * to.x + map[1] * to.y - from.x;
  map[5] += map[3] * to.x + map[4] * to.y - from.y;
  cv::Mat result;
  cv::warpAffine(image, result, cv::Mat(2, 3, CV_64F, map.data()), to.size(),
                 interpolation | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  return result;
}

/// value / 255, rounded, of 0..255 * 255.
std::uint8_t of_255(unsigned value) {
  value += 128;
  return static_cast<std::uint8_t>((value + (value >> 8)) >> 8);
}

void lay_over(const cv::Mat& colour, const cv::Mat& cover, cv::Mat frame) {
  const int channels = colour.channels();
  for (int y = 0; y < cover.rows; ++y) {
    const std::uint8_t* above = colour.ptr(y);
    const std::uint8_t* share = cover.ptr(y);
    std::uint8_t* below = frame.ptr(y);
    for (int x = 0; x < cover.cols; ++x, above += channels, below += channels) {
      const unsigned part = share[x];
      if (part == 0) continue;
      for (int c = 0; c < channels; ++c) {
        below[c] = of_255(part * above[c] + (255 - part) * below[c]);
      }
    }
  }
}

}  // namespace

StillLayers::StillLayers(const cv::Mat& image, std::vector<StillObject> objects)
    : background_(image) {
  const auto moves = [](const StillObject& object) { return object.reach_px > 0; };
  if (std::ranges::none_of(objects, moves)) return;
  std::ranges::stable_sort(objects, {}, &StillObject::lower_edge);
  cv::Mat owner(image.rows, image.cols, CV_16UC1, cv::Scalar(0));  // 1 + the layer in front
  for (const StillObject& object : objects) {
    const cv::Rect area = pixels_of(bounds(object.outline), kRoom_px, whole(image));
    if (area.empty()) continue;
    GreyImage mask = mask_within(object.outline, area);
    const cv::Mat pixels(area.height, area.width, CV_8UC1, mask.pixels.data());
    if (cv::countNonZero(pixels) == 0) continue;
    layers_.push_back({object.box, area, pixels.clone(), image(area), {}, object.reach_px});
    owner(area).setTo(static_cast<double>(layers_.size()), pixels);
  }
  fill_background(owner);
  for (std::size_t i = 0; i < layers_.size(); ++i) fill_layer(i, image, owner);
  std::erase_if(layers_, [](const Layer& layer) { return layer.cover.empty(); });
}

/// Where objects move away; but for what they are certain to cover themselves.
void StillLayers::fill_background(const cv::Mat& owner) {
  cv::Mat hole(owner.size(), CV_8UC1, cv::Scalar(0));
  cv::Mat stays(owner.size(), CV_8UC1, cv::Scalar(0));
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const Layer& layer = layers_[i];
    (layer.reach_px > 0 ? hole : stays)(layer.area)
        .setTo(255, owner(layer.area) == static_cast<double>(i + 1));
  }
  const int side = 2 * kMargin_px + 1;
  cv::dilate(hole, hole, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  hole.setTo(0, stays);
  cv::Mat wanted = hole.clone();
  for (const Layer& layer : layers_) {
    cv::Mat depth;
    cv::distanceTransform(layer.mask, depth, cv::DIST_L2, cv::DIST_MASK_5);
    wanted(layer.area).setTo(0, depth > layer.reach_px + kSlack_px);
  }
  cv::Rect area = cv::boundingRect(hole);
  if (area.empty()) return;
  area = cv::Rect(area.x - kRoom_px, area.y - kRoom_px, area.width + 2 * kRoom_px,
                  area.height + 2 * kRoom_px) &
         whole(hole);
  background_ = background_.clone();
  cv::Mat part = background_(area);
  continue_into(part, hole(area) == 0, wanted(area));
}

/// Where nearer objects hide it; a layer of which nothing can be seen gets no cover.
void StillLayers::fill_layer(std::size_t number, const cv::Mat& image, const cv::Mat& owner) {
  Layer& layer = layers_[number];
  const double code = static_cast<double>(number + 1);
  if (cv::countNonZero(owner(layer.area) == code) == 0) return;
  double reach_px = 0;
  for (std::size_t i = number; i < layers_.size(); ++i) {
    reach_px = std::max(reach_px, layers_[i].reach_px);
  }
  reach_px += layer.reach_px + kSlack_px;
  const int room = static_cast<int>(std::ceil(reach_px));
  const cv::Rect around = cv::Rect(layer.area.x - room, layer.area.y - room,
                                   layer.area.width + 2 * room, layer.area.height + 2 * room) &
                          whole(owner);
  if (cv::countNonZero(owner(around) > code) > 0) {
    cv::Mat mask(around.size(), CV_8UC1, cv::Scalar(0));
    const cv::Rect inner(layer.area.tl() - around.tl(), layer.area.size());
    layer.mask.copyTo(mask(inner));
    cv::Mat far;
    cv::distanceTransform(mask == 0, far, cv::DIST_L2, cv::DIST_MASK_5);
    const cv::Mat hidden = (owner(around) > code) & (far <= reach_px);
    layer.area = around;
    layer.mask = mask | hidden;
    layer.colour = image(around).clone();
    continue_into(layer.colour, owner(around) == code, hidden);
  }
  cv::GaussianBlur(layer.mask != 0, layer.cover, {3, 3}, 0, 0, cv::BORDER_REPLICATE);
}

/// Where in the frame a layer can be seen.
cv::Rect StillLayers::seen_in(const Layer& layer, const AffineMap& map) const {
  const double right = background_.cols - 1, bottom = background_.rows - 1;
  double beyond = 0;  // how far the frame looks over the image's border, where objects go on
  for (const Point corner : {Point{0, 0}, {right, 0}, {0, bottom}, {right, bottom}}) {
    const Point at = apply(map, corner);
    beyond = std::max({beyond, -at.x, -at.y, at.x - right, at.y - bottom});
  }
  const cv::Rect& area = layer.area;
  Rectangle source{double(area.x), double(area.y), double(area.br().x), double(area.br().y)};
  if (area.x == 0) source.left -= beyond;
  if (area.y == 0) source.top -= beyond;
  if (area.br().x == background_.cols) source.right += beyond;
  if (area.br().y == background_.rows) source.bottom += beyond;
  const AffineMap back = inverse(map);
  constexpr double kFar = 1e9;
  Rectangle seen{kFar, kFar, -kFar, -kFar};
  for (const Point corner : {Point{source.left, source.top},
                             {source.right, source.top},
                             {source.left, source.bottom},
                             {source.right, source.bottom}}) {
    const Point at = apply(back, corner);
    seen = {std::min(seen.left, at.x), std::min(seen.top, at.y), std::max(seen.right, at.x),
            std::max(seen.bottom, at.y)};
  }
  return pixels_of(seen, kRoom_px, whole(background_));
}

cv::Mat StillLayers::frame(const AffineMap& background,
                           const std::vector<AffineMap>& objects) const {
  cv::Mat frame = is_identity(background)
                      ? background_.clone()
                      : sampled(background_, {}, background, whole(background_), cv::INTER_CUBIC);
  for (const Layer& layer : layers_) {
    const AffineMap& map = objects[layer.box];
    const cv::Rect seen = seen_in(layer, map);
    if (seen.empty()) continue;
    lay_over(sampled(layer.colour, layer.area.tl(), map, seen, cv::INTER_CUBIC),
             sampled(layer.cover, layer.area.tl(), map, seen, cv::INTER_LINEAR), frame(seen));
  }
  return frame;
}

}  // namespace eventgan
