#include "stages/frames/decoding/detail/scaled_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>
#include <span>
#include <utility>

#include "stages/base/processor_clones.h"

namespace eventgan {
namespace {

constexpr int kPlaceBits = 5;  // places are rounded to 1/32 px, as OpenCV does,
constexpr int kParts = 1 << kPlaceBits;
constexpr int kFineBits = 10;  // and summed in 1/1024
constexpr int kTaps = 4;       // pixels of the photograph in a row that a sample is made of
constexpr int kBefore = 4;     // beyond the border: where all that is seen is the border's pixel
constexpr int kBehind = 8;
constexpr int kWeightBits = 14;
constexpr int kWeight = 1 << kWeightBits;  // of all weights together
constexpr int kShareBits = 11;
constexpr int kShare = 1 << kShareBits;  // of both pixels of a resized one
constexpr int kLevel = 128;              // of a plane, to a grey level
constexpr int kRowLevel = kLevel / 4;    // of a row: the upper half of a product is kept
constexpr int kWhite = 255 * kRowLevel;

using Weights = std::array<std::int16_t, 2 * kTaps>;  // twice the same

constexpr double cubic(double x) {  // Keys with a = -0.75
  x = x < 0 ? -x : x;
  if (x <= 1) return (1.25 * x - 2.25) * x * x + 1;
  return x < 2 ? ((-0.75 * x + 3.75) * x - 6) * x + 3 : 0;
}

constexpr double linear(double x) {
  x = x < 0 ? -x : x;
  return x < 1 ? 1 - x : 0;
}

/// Weights of the pixels -1, 0, 1, and 2 of a sample at `place` / 32 px, 0 to 31.
using Kernel = std::array<Weights, kParts>;

template <class Function>
Kernel make_kernel(Function function) {
  Kernel kernel{};
  for (int place = 0; place < kParts; ++place) {
    Weights& weights = kernel[static_cast<std::size_t>(place)];
    int sum = 0;
    for (int k = 0; k < kTaps; ++k) {
      const double weight = function(k - 1 - double(place) / kParts);
      weights[static_cast<std::size_t>(k)] =
          static_cast<std::int16_t>(std::lround(kWeight * weight));
      sum += weights[static_cast<std::size_t>(k)];
    }
    *std::ranges::max_element(weights) += static_cast<std::int16_t>(kWeight - sum);
    std::copy_n(weights.begin(), kTaps, weights.begin() + kTaps);
  }
  return kernel;
}

const Kernel kCubic = make_kernel(cubic);
const Kernel kLinear = make_kernel(linear);

int to_place(double px) {
  return static_cast<int>(std::lround(std::clamp(px, -1e6, 1e6) * (1 << kFineBits)));
}

/// Where a row of samples lies: for each of them a part that is its column's, plus what is the
/// row's, in 1/1024 px; and the share of the second column and row in a sample.
struct RowPlaces {
  std::span<const int> x, y;
  std::span<const std::int32_t> shares_x;
  int row_x, row_y;
  std::int32_t shares_y;
};

/// Samples `values`, [y, x] of the size, which has its border around it: four places a pixel
/// apart, each of them within black and white, as they are in an image that is resized.
EVENTGAN_CLONES void sample(const std::int16_t* values, std::ptrdiff_t stride, int width,
                            int height, const Kernel& kernel, const RowPlaces& places,
                            std::span<std::int16_t> row) {
  constexpr int kShift = kFineBits - kPlaceBits, kRound = 1 << (kShift - 1);
  const cv::v_int16x8 shares_y = cv::v_reinterpret_as_s16(cv::v_setall_s32(places.shares_y));
  const cv::v_int16x8 white = cv::v_setall_s16(kWhite);
  for (std::size_t i = 0; i < row.size(); ++i) {
    const int x = std::clamp((places.row_x + places.x[i] + kRound) >> kShift, -3 * kParts,
                             (width + 1) * kParts);
    const int y = std::clamp((places.row_y + places.y[i] + kRound) >> kShift, -3 * kParts,
                             (height + 1) * kParts);
    const std::int16_t* from = values + ((y >> 5) - 1) * stride + ((x >> 5) - 1);
    const Weights& down = kernel[static_cast<std::size_t>(y & 31)];
    const auto row_of = [&](int j) { return cv::v_load(from + j * stride); };
    // Products, and what follows, are rounded down: by 1/2 at a time, that many times.
    cv::v_int16x8 upper = cv::v_setall_s16((kTaps + 3) / 2), lower = upper, next = row_of(0);
    for (int j = 0; j < kTaps; ++j) {
      const cv::v_int16x8 weight = cv::v_setall_s16(down[static_cast<std::size_t>(j)]);
      upper += cv::v_mul_hi(next, weight);
      next = row_of(j + 1);
      lower += cv::v_mul_hi(next, weight);
    }
    const cv::v_int16x8 along = cv::v_load(kernel[static_cast<std::size_t>(x & 31)].data());
    const auto both = [&](const cv::v_int16x8& column) {  // from its first pixel, and its second
      return cv::v_dotprod(cv::v_combine_low(column, cv::v_rotate_right<1>(column)), along);
    };
    cv::v_int32x4 left, right;
    cv::v_zip(both(upper), both(lower), left, right);
    const cv::v_int32x4 four =
        (cv::v_combine_low(left, right) + cv::v_combine_high(left, right)) >> kWeightBits;
    const cv::v_int16x8 seen =
        cv::v_min(cv::v_max(cv::v_pack(four, four), cv::v_setzero_s16()), white);
    const cv::v_int32x4 two = cv::v_dotprod(seen, shares_y) >> kShareBits;
    const cv::v_int16x8 shares_x = cv::v_reinterpret_as_s16(cv::v_setall_s32(places.shares_x[i]));
    row[i] = static_cast<std::int16_t>(cv::v_dotprod(cv::v_pack(two, two), shares_x).get0() >>
                                       kShareBits);
  }
}

/// 128 a level, of what OpenCV makes grey of the photograph.
cv::Mat levels_of(const cv::Mat& image) {
  cv::Mat levels(image.size(), CV_16SC1);
  for (int y = 0; y < image.rows; ++y) {
    const std::uint8_t* from = image.ptr(y);
    auto* to = levels.ptr<std::int16_t>(y);
    if (image.channels() == 1) {
      for (int x = 0; x < image.cols; ++x) to[x] = static_cast<std::int16_t>(kLevel * from[x]);
    } else {
      for (int x = 0; x < image.cols; ++x) {
        const int grey = 3735 * from[3 * x] + 19235 * from[3 * x + 1] + 9798 * from[3 * x + 2];
        to[x] = static_cast<std::int16_t>((grey + 128) >> 8);
      }
    }
  }
  return levels;
}

bool is_identity(const AffineMap& map) {
  constexpr AffineMap kIdentity{1, 0, 0, 0, 1, 0};
  return std::ranges::equal(map, kIdentity,
                            [](double a, double b) { return std::abs(a - b) < 1e-9; });
}

/// With that, frames are on average as bright as the labelled one, which OpenCV resizes: it rounds
/// down by an eighth of a level, but up by as much to exactly half the size.
int half_level_of(const Placement& placement) {
  constexpr int kHalf = kRowLevel / 2, kEighth = kRowLevel / 8;
  const ImageSize cut = placement.cut(), scaled = placement.scaled;
  if (cut == scaled) return kHalf;
  const bool is_half = cut.width == 2 * scaled.width && cut.height == 2 * scaled.height;
  return is_half ? kHalf + kEighth : kHalf - kEighth;
}

cv::Mat with_border(const cv::Mat& values) {
  cv::Mat bordered;
  cv::copyMakeBorder(values, bordered, kBefore, kBehind, kBefore, kBehind, cv::BORDER_REPLICATE);
  return bordered;
}

}  // namespace

ScaledLayers::Axis ScaledLayers::axis(int begin, int cut, int scaled) {
  Axis axis;
  const double step = double(cut) / scaled;
  for (int i = 0; i < scaled; ++i) {
    const double place = std::clamp((i + 0.5) * step - 0.5, 0.0, cut - 1.0);
    const double first = std::floor(place);
    axis.place_px.push_back(begin + first);
    axis.share.push_back(static_cast<int>(std::lround(kShare * (place - first))));
    axis.shares.push_back((axis.share.back() << 16) + kShare - axis.share.back());
  }
  return axis;
}

ScaledLayers::ScaledLayers(const StillLayers& layers, const Placement& placement, cv::Point origin,
                           cv::Mat resting)
    : layers_(layers),
      columns_(axis(origin.x + placement.border_x, placement.cut().width, placement.scaled.width)),
      rows_(axis(origin.y + placement.border_y, placement.cut().height, placement.scaled.height)),
      half_level_(half_level_of(placement)),
      resting_(std::move(resting)) {
  if (resting_.empty()) background_ = with_border(levels_of(layers.background()));
  for (const StillLayers::Layer& layer : layers.layers()) {
    cv::Mat covering = levels_of(layer.colour);
    for (int y = 0; y < covering.rows; ++y) {
      const std::uint8_t* cover = layer.cover.ptr(y);
      auto* levels = covering.ptr<std::int16_t>(y);
      for (int x = 0; x < covering.cols; ++x) {
        levels[x] = static_cast<std::int16_t>((levels[x] * cover[x] + 127) / 255);
      }
    }
    planes_.push_back({with_border(covering), with_border(levels_of(layer.cover))});
  }
}

/// A map, for all of the frame's columns.
class ScaledLayers::Sampler {
 public:
  Sampler(const ScaledLayers& scaled, const AffineMap& map, cv::Point origin)
      : scaled_(scaled), map_(map), origin_(origin) {
    const Axis& columns = scaled.columns_;
    for (std::size_t i = 0; i < columns.place_px.size(); ++i) {
      const double share = double(columns.share[i]) / kShare;  // the middle of both is moved
      x_.push_back(to_place(map[0] * (columns.place_px[i] + share) - share));
      y_.push_back(to_place(map[3] * (columns.place_px[i] + share)));
    }
  }

  void row(const cv::Mat& plane, const Kernel& kernel, int y, cv::Range columns,
           std::int16_t* row) const {
    const auto from = static_cast<std::size_t>(columns.start);
    const auto count = static_cast<std::size_t>(columns.size());
    const int share = scaled_.rows_.share[static_cast<std::size_t>(y)];
    const double part = double(share) / kShare;
    const double place = scaled_.rows_.place_px[static_cast<std::size_t>(y)] + part;
    const RowPlaces places{std::span(x_).subspan(from, count),
                           std::span(y_).subspan(from, count),
                           std::span(scaled_.columns_.shares).subspan(from, count),
                           to_place(map_[1] * place + map_[2] - origin_.x),
                           to_place(map_[4] * place + map_[5] - origin_.y - part),
                           scaled_.rows_.shares[static_cast<std::size_t>(y)]};
    const auto stride = static_cast<std::ptrdiff_t>(plane.step1());
    sample(plane.ptr<std::int16_t>(kBefore) + kBefore, stride, plane.cols - kBefore - kBehind,
           plane.rows - kBefore - kBehind, kernel, places, {row, count});
  }

 private:
  const ScaledLayers& scaled_;
  AffineMap map_;
  cv::Point origin_;
  std::vector<int> x_, y_;
};

cv::Rect ScaledLayers::seen_in(const StillLayers::Layer& layer, const AffineMap& map) const {
  const cv::Rect seen = layers_.seen_in(layer, map);
  const auto range = [](const Axis& axis, int from, int to) {
    const auto first = std::ranges::lower_bound(axis.place_px, from - 1.0);
    const auto last = std::ranges::upper_bound(axis.place_px, to + 0.0);
    return cv::Range(static_cast<int>(first - axis.place_px.begin()),
                     static_cast<int>(last - axis.place_px.begin()));
  };
  const cv::Range x = range(columns_, seen.x, seen.br().x);
  const cv::Range y = range(rows_, seen.y, seen.br().y);
  return {x.start, y.start, std::max(x.size(), 0), std::max(y.size(), 0)};
}

cv::Mat ScaledLayers::frame(const AffineMap& background,
                            const std::vector<AffineMap>& objects) const {
  struct Drawn {
    const Planes* planes;
    cv::Rect seen;
    Sampler sampler;
    bool rests;
  };
  std::vector<Drawn> drawn;
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    const StillLayers::Layer& layer = layers_.layers()[i];
    const AffineMap& map = objects[layer.box];
    const cv::Rect seen = seen_in(layer, map);
    if (seen.empty()) continue;
    drawn.push_back({&planes_[i], seen, Sampler(*this, map, layer.area.tl()),
                     !resting_.empty() && is_identity(map)});
  }
  const int width = static_cast<int>(columns_.place_px.size());
  const int height = static_cast<int>(rows_.place_px.size());
  const Sampler behind(*this, background, {});
  cv::Mat frame(height, width, CV_8UC1);
  std::vector<std::int16_t> row(static_cast<std::size_t>(width)), base, covering(row), cover(row);
  for (int y = 0; y < height; ++y) {
    if (resting_.empty()) {
      behind.row(background_, kCubic, y, {0, width}, row.data());
    } else {
      std::transform(resting_.ptr(y), resting_.ptr(y) + width, row.begin(), [](std::uint8_t level) {
        return static_cast<std::int16_t>(kRowLevel * level);
      });
      base = row;
    }
    for (const Drawn& layer : drawn) {
      if (y < layer.seen.y || y >= layer.seen.br().y) continue;
      cv::Range columns(layer.seen.x, layer.seen.br().x);
      layer.sampler.row(layer.planes->cover, kLinear, y, columns, cover.data() + columns.start);
      while (columns.start < columns.end && cover[columns.start] == 0) ++columns.start;
      while (columns.start < columns.end && cover[columns.end - 1] == 0) --columns.end;
      layer.sampler.row(layer.planes->covering, kCubic, y, columns,
                        covering.data() + columns.start);
      for (int x = columns.start; x < columns.end; ++x) {
        if (layer.rests && row[x] == base[x]) continue;
        const int behind_it = (kWhite - cover[x]) * row[x] / kWhite;
        row[x] = static_cast<std::int16_t>(covering[x] + behind_it);
      }
    }
    std::ranges::transform(row, frame.ptr(y), [this](std::int16_t level) {
      return static_cast<std::uint8_t>(std::min((level + half_level_) / kRowLevel, 255));
    });
  }
  return frame;
}

}  // namespace eventgan
