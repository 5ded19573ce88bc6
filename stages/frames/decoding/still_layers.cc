#include "stages/frames/decoding/detail/still_layers.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "manifests/values/frames.h"
#include "manifests/values/outlines.h"

namespace eventgan {
namespace {

constexpr int kRoom_px = 2;    // around a mask: what its edge and sampling reach
constexpr int kMargin_px = 3;  // what drawn outlines leave out of an object
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

// What is wanted of a pixel: to be like something, or to be what is mirrored there, if anything is.
constexpr std::uint8_t kAnything = 1, kMirrored = 2;

/// Gives each `wanted` pixel of `picture` the `known` one which is its mirror image at the nearest
/// known pixel; if that is not known either, one half-way to the nearest, or this itself. Where
/// that is not wanted, `wanted` becomes 0. All have one size; what is wanted is not known.
void continue_into(cv::Mat& picture, const cv::Mat& known, cv::Mat& wanted) {
  cv::Mat distance, labels;
  cv::distanceTransform(known == 0, distance, labels, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  std::vector<cv::Point> places;  // of known pixels, by label
  places.reserve(known.total() + 1);
  for (int y = 0; y < known.rows; ++y) {
    const std::uint8_t* is_known = known.ptr(y);
    const int* label_of = labels.ptr<int>(y);
    for (int x = 0; x < known.cols; ++x) {
      if (is_known[x] == 0) continue;
      const auto label = static_cast<std::size_t>(label_of[x]);
      if (places.size() <= label) places.resize(label + 1);
      places[label] = {x, y};
    }
  }
  if (places.empty()) return;
  const auto is_known = [&](cv::Point at) {
    return whole(known).contains(at) && known.at<std::uint8_t>(at) != 0;
  };
  const auto bytes = static_cast<std::size_t>(picture.channels());
  for (int y = 0; y < wanted.rows; ++y) {
    std::uint8_t* wants = wanted.ptr(y);
    for (int x = 0; x < wanted.cols; ++x) {
      std::uint8_t& want = wants[x];
      if (want == 0) continue;
      const cv::Point nearest = places[static_cast<std::size_t>(labels.at<int>(y, x))];
      cv::Point step = nearest - cv::Point(x, y);
      if (want == kMirrored && !is_known(nearest + step)) {
        want = 0;
        continue;
      }
      while (!is_known(nearest + step)) step = {step.x / 2, step.y / 2};  // ends at the nearest
      const cv::Point from = nearest + step;
      std::copy_n(picture.ptr(from.y) + bytes * static_cast<std::size_t>(from.x), bytes,
                  picture.ptr(y) + bytes * static_cast<std::size_t>(x));
    }
  }
}

cv::Rect grown(const cv::Rect& area, int room, const cv::Mat& image) {
  return cv::Rect(area.x - room, area.y - room, area.width + 2 * room, area.height + 2 * room) &
         whole(image);
}

const cv::Mat& checked(const cv::Mat& image) {
  if (std::max(image.rows, image.cols) <= kMostStillSide) return image;
  throw std::invalid_argument("expected a still of at most " + std::to_string(kMostStillSide) +
                              " pixels a side, got " +
                              to_string(ImageSize{image.rows, image.cols}));
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

bool is_identity(const AffineMap& map) {
  constexpr AffineMap kIdentity{1, 0, 0, 0, 1, 0};
  constexpr double kRounding = 1e-9;
  return std::ranges::equal(map, kIdentity,
                            [](double a, double b) { return std::abs(a - b) < kRounding; });
}

StillLayers::StillLayers(const cv::Mat& image, std::vector<StillObject> objects, double behind_px)
    : behind_px_(behind_px), background_(checked(image)) {
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

bool StillLayers::can_be_seen(std::size_t number, const cv::Mat& owner) const {
  return cv::countNonZero(owner(layers_[number].area) == static_cast<double>(number + 1)) > 0;
}

/// Where objects move away; but for what they are certain to cover themselves.
void StillLayers::fill_background(const cv::Mat& owner) {
  cv::Mat hole(owner.size(), CV_8UC1, cv::Scalar(0));
  cv::Mat stays(owner.size(), CV_8UC1, cv::Scalar(0));
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const Layer& layer = layers_[i];
    const double code = static_cast<double>(i + 1);
    if (layer.reach_px == 0) {
      stays(layer.area).setTo(1, owner(layer.area) == code);
      continue;
    }
    // Around what hardly moves hardly anything comes to light, drawn well or not.
    const int margin = std::clamp(static_cast<int>(layer.reach_px / 2), 1, kMargin_px);
    const cv::Rect around = grown(layer.area, margin, owner);
    cv::Mat left;
    cv::dilate(owner(around) == code, left,
               cv::getStructuringElement(cv::MORPH_RECT, {2 * margin + 1, 2 * margin + 1}));
    hole(around).setTo(kAnything, left);
  }
  hole.setTo(0, stays);
  cv::Mat wanted = hole.clone();
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const Layer& layer = layers_[i];
    // What it covers however it moves. Beyond half of its size that is little or nothing.
    const int reach = static_cast<int>(std::ceil(layer.reach_px + kSlack_px));
    if (!can_be_seen(i, owner) || 2 * reach >= std::max(layer.area.width, layer.area.height)) {
      continue;
    }
    cv::Mat covered;
    cv::erode(layer.mask, covered,
              cv::getStructuringElement(cv::MORPH_RECT, {2 * reach + 1, 2 * reach + 1}));
    wanted(layer.area).setTo(0, covered);
  }
  cv::Rect area = cv::boundingRect(hole);
  if (area.empty()) return;
  area = grown(area, 1 + kRoom_px, hole);
  background_ = background_.clone();
  cv::Mat part = background_(area), wanted_part = wanted(area);
  continue_into(part, hole(area) == 0, wanted_part);
}

/// Where nearer objects hide it; a layer of which nothing can be seen gets no cover.
void StillLayers::fill_layer(std::size_t number, const cv::Mat& image, const cv::Mat& owner) {
  Layer& layer = layers_[number];
  if (!can_be_seen(number, owner)) return;
  const double code = static_cast<double>(number + 1);
  double reach_px = 0;
  for (std::size_t i = number; i < layers_.size(); ++i) {
    reach_px = std::max(reach_px, layers_[i].reach_px);
  }
  reach_px = std::min(reach_px + layer.reach_px + kSlack_px, behind_px_);
  const cv::Rect around = grown(layer.area, static_cast<int>(std::ceil(reach_px)), owner);
  if (cv::countNonZero(owner(around) > code) > 0) {
    cv::Mat mask(around.size(), CV_8UC1, cv::Scalar(0));
    layer.mask.copyTo(mask(cv::Rect(layer.area.tl() - around.tl(), layer.area.size())));
    cv::Mat far;
    cv::distanceTransform(mask == 0, far, cv::DIST_L2, cv::DIST_MASK_5);
    cv::Mat hidden(around.size(), CV_8UC1, cv::Scalar(0));
    hidden.setTo(kMirrored, far <= reach_px);
    hidden.setTo(kAnything, mask);
    hidden.setTo(0, owner(around) <= code);
    layer.area = around;
    layer.colour = image(around).clone();
    continue_into(layer.colour, owner(around) == code, hidden);
    layer.mask = mask | hidden;
  }
  cv::GaussianBlur(layer.mask != 0, layer.cover, {3, 3}, 0, 0, cv::BORDER_REPLICATE);
}

cv::Rect StillLayers::seen_in(const Layer& layer, const AffineMap& map) const {
  const double right = background_.cols - 1, bottom = background_.rows - 1;
  double beyond = 0;  // how far the frame looks over the image's border, where objects go on
  for (const Point corner : {Point{0, 0}, {right, 0}, {0, bottom}, {right, bottom}}) {
    const Point at = mapped(map, corner);
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
    const Point at = mapped(back, corner);
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
  for (const Layer& layer : layers_) draw(layer, objects[layer.box], frame);
  return frame;
}

cv::Mat StillLayers::resting_frame(const std::vector<AffineMap>& objects) const {
  cv::Mat frame = background_.clone();
  for (const Layer& layer : layers_) {
    if (is_identity(objects[layer.box])) draw(layer, objects[layer.box], frame);
  }
  return frame;
}

void StillLayers::draw(const Layer& layer, const AffineMap& map, cv::Mat& frame) const {
  const cv::Rect seen = seen_in(layer, map);
  if (seen.empty()) return;
  lay_over(sampled(layer.colour, layer.area.tl(), map, seen, cv::INTER_CUBIC),
           sampled(layer.cover, layer.area.tl(), map, seen, cv::INTER_LINEAR), frame(seen));
}

cv::Mat StillLayers::seen(const std::vector<AffineMap>& objects) const {
  if (layers_.empty()) return {};
  cv::Mat seen(background_.size(), CV_16UC1, cv::Scalar(0));
  for (const Layer& layer : layers_) {
    const AffineMap& map = objects[layer.box];
    const cv::Rect area = seen_in(layer, map);
    if (area.empty()) continue;
    constexpr int kHalf = 128;
    seen(area).setTo(static_cast<double>(layer.box + 1),
                     sampled(layer.cover, layer.area.tl(), map, area, cv::INTER_NEAREST) >= kHalf);
  }
  return seen;
}

}  // namespace eventgan
