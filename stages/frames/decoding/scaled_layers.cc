#include "stages/frames/decoding/detail/scaled_layers.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "stages/base/processor_clones.h"

namespace eventgan {
namespace {

int to_place(double px) {
  return static_cast<int>(std::lround(std::clamp(px, -1e6, 1e6) * (1 << kSampleFineBits)));
}

EVENTGAN_CLONES void grey_levels(const std::uint8_t* bgr, std::span<std::int16_t> levels) {
  for (std::size_t x = 0; x < levels.size(); ++x) {
    const int grey = 3735 * bgr[3 * x] + 19235 * bgr[3 * x + 1] + 9798 * bgr[3 * x + 2];
    levels[x] = static_cast<std::int16_t>((grey + 128) >> 8);
  }
}

/// kPlaneLevel a level, of what OpenCV makes grey of the photograph.
cv::Mat levels_of(const cv::Mat& image) {
  cv::Mat levels(image.size(), CV_16SC1);
  if (image.channels() == 1) {
    image.convertTo(levels, CV_16S, kPlaneLevel);
    return levels;
  }
  for (int y = 0; y < image.rows; ++y) {
    grey_levels(image.ptr(y), {levels.ptr<std::int16_t>(y), static_cast<std::size_t>(levels.cols)});
  }
  return levels;
}

/// With that, frames are on average as bright as the labelled one that OpenCV resizes: it rounds
/// down by an eighth of a level, but up by as much to exactly half the size.
int half_level_of(const Placement& placement) {
  constexpr int kHalf = kRowLevel / 2, kEighth = kRowLevel / 8;
  const ImageSize cut = placement.cut(), scaled = placement.scaled;
  if (cut == scaled) return kHalf;
  const bool is_half = cut.width == 2 * scaled.width && cut.height == 2 * scaled.height;
  return is_half ? kHalf + kEighth : kHalf - kEighth;
}

}  // namespace

ScaledLayers::Axis ScaledLayers::axis(double begin, double cut, int scaled) {
  Axis axis;
  const double step = cut / scaled, begin_px = std::floor(begin);
  for (int i = 0; i < scaled; ++i) {
    const double place = std::clamp((i + 0.5) * step - 0.5, 0.0, cut - 1.0) + (begin - begin_px);
    const double first = std::floor(place);
    axis.place_px.push_back(begin_px + first);
    axis.share.push_back(static_cast<int>(std::lround(kSampleShare * (place - first))));
    axis.shares.push_back((axis.share.back() << 16) + kSampleShare - axis.share.back());
  }
  return axis;
}

ScaledLayers::ScaledLayers(const StillLayers& layers, const Placement& placement, cv::Point origin,
                           int reduced_by, cv::Mat resting)
    : layers_(layers),
      columns_(axis(double(origin.x + placement.border_x) / reduced_by,
                    double(placement.cut().width) / reduced_by, placement.scaled.width)),
      rows_(axis(double(origin.y + placement.border_y) / reduced_by,
                 double(placement.cut().height) / reduced_by, placement.scaled.height)),
      half_level_(reduced_by > 1 ? kRowLevel / 2 : half_level_of(placement)),
      resting_(std::move(resting)) {
  if (resting_.empty()) background_.emplace(levels_of(layers.background()));
  for (const StillLayers::Layer& layer : layers.layers()) {
    cv::Mat covering = levels_of(layer.colour);
    for (int y = 0; y < covering.rows; ++y) {
      const std::uint8_t* cover = layer.cover.ptr(y);
      auto* levels = covering.ptr<std::int16_t>(y);
      for (int x = 0; x < covering.cols; ++x) {
        levels[x] = static_cast<std::int16_t>((levels[x] * cover[x] + 127) / 255);
      }
    }
    planes_.push_back({SampledPlane(covering), SampledPlane(levels_of(layer.cover))});
  }
}

/// A map, for all of the frame's columns.
class ScaledLayers::Sampler {
 public:
  Sampler(const ScaledLayers& scaled, const AffineMap& map, cv::Point origin)
      : scaled_(scaled), map_(map), origin_(origin) {
    const Axis& columns = scaled.columns_;
    for (std::size_t i = 0; i < columns.place_px.size(); ++i) {
      const double share = double(columns.share[i]) / kSampleShare;  // the middle of both is moved
      x_.push_back(to_place(map[0] * (columns.place_px[i] + share) - share));
      y_.push_back(to_place(map[3] * (columns.place_px[i] + share)));
    }
  }

  void row(const SampledPlane& plane, const SampleKernel& kernel, int y, cv::Range columns,
           std::int16_t* row) const {
    const auto from = static_cast<std::size_t>(columns.start);
    const auto count = static_cast<std::size_t>(columns.size());
    const int share = scaled_.rows_.share[static_cast<std::size_t>(y)];
    const double part = double(share) / kSampleShare;
    const double place = scaled_.rows_.place_px[static_cast<std::size_t>(y)] + part;
    const SampledPlaces places{std::span(x_).subspan(from, count),
                               std::span(y_).subspan(from, count),
                               std::span(scaled_.columns_.shares).subspan(from, count),
                               to_place(map_[1] * place + map_[2] - origin_.x),
                               to_place(map_[4] * place + map_[5] - origin_.y - part),
                               scaled_.rows_.shares[static_cast<std::size_t>(y)]};
    sample_row(plane, kernel, places, {row, count});
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
      behind.row(*background_, kCubicSamples, y, {0, width}, row.data());
    } else {
      std::transform(resting_.ptr(y), resting_.ptr(y) + width, row.begin(), [](std::uint8_t level) {
        return static_cast<std::int16_t>(kRowLevel * level);
      });
      base = row;
    }
    for (const Drawn& layer : drawn) {
      if (y < layer.seen.y || y >= layer.seen.br().y) continue;
      cv::Range columns(layer.seen.x, layer.seen.br().x);
      layer.sampler.row(layer.planes->cover, kLinearSamples, y, columns,
                        cover.data() + columns.start);
      while (columns.start < columns.end && cover[columns.start] == 0) ++columns.start;
      while (columns.start < columns.end && cover[columns.end - 1] == 0) --columns.end;
      layer.sampler.row(layer.planes->covering, kCubicSamples, y, columns,
                        covering.data() + columns.start);
      for (int x = columns.start; x < columns.end; ++x) {
        if (layer.rests && row[x] == base[x]) continue;
        const int behind_it = (kRowWhite - cover[x]) * row[x] / kRowWhite;
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
