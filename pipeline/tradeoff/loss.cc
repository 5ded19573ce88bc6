#include "pipeline/tradeoff/loss.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "pipeline/generators/calibrate.h"
#include "stages/generator/wanted_tiles.h"

namespace eventgan {
namespace {

/// The pixels of one row or column of the old grid that a new pixel covers, with the share of it
/// that each has.
struct Cover {
  int first = 0;
  std::vector<double> shares;
};

/// One axis: an edge of the source at x lies at x s + o on either grid, so that of the new grid at
/// X lies at (X - o_to) s_from / s_to + o_from on the old one.
std::vector<Cover> covers(int from_side, double from_scale, int from_offset, int to_side,
                          double to_scale, int to_offset) {
  const double step = from_scale / to_scale;  // a new pixel's side in old pixels
  std::vector<Cover> all(static_cast<std::size_t>(to_side));
  for (int x = 0; x < to_side; ++x) {
    const double begin = (x - to_offset) * step + from_offset;
    const double end = begin + step;
    Cover& cover = all[static_cast<std::size_t>(x)];
    cover.first = std::clamp(static_cast<int>(std::floor(begin)), 0, from_side);
    for (int old = cover.first; old < from_side && old < end; ++old) {
      const double overlap = std::min(end, old + 1.0) - std::max<double>(begin, old);
      cover.shares.push_back(std::max(overlap, 0.0) / step);
    }
  }
  return all;
}

}  // namespace

std::vector<float> on_grid(std::vector<float> values, int channels, const Placement& from,
                           const Placement& to) {
  const std::size_t plane = from.volume.pixel_count();
  if (values.size() != static_cast<std::size_t>(channels) * plane || from.source != to.source) {
    throw std::invalid_argument("expected " + std::to_string(channels) + " channels of " +
                                std::to_string(plane) + " pixels of one source image, got " +
                                std::to_string(values.size()) + " values");
  }
  if (from == to) return values;
  const auto columns = covers(from.volume.width, from.scale_x(), from.offset_x, to.volume.width,
                              to.scale_x(), to.offset_x);
  const auto rows = covers(from.volume.height, from.scale_y(), from.offset_y, to.volume.height,
                           to.scale_y(), to.offset_y);
  std::vector<float> result;
  result.reserve(static_cast<std::size_t>(channels) * to.volume.pixel_count());
  for (int channel = 0; channel < channels; ++channel) {
    const float* const old = values.data() + static_cast<std::size_t>(channel) * plane;
    for (const Cover& row : rows) {
      for (const Cover& column : columns) {
        double sum = 0;
        for (std::size_t i = 0; i < row.shares.size(); ++i) {
          const float* const line = old +
                                    (static_cast<std::size_t>(row.first) + i) *
                                        static_cast<std::size_t>(from.volume.width) +
                                    column.first;
          for (std::size_t j = 0; j < column.shares.size(); ++j) {
            sum += row.shares[i] * column.shares[j] * static_cast<double>(line[j]);
          }
        }
        result.push_back(static_cast<float>(sum));
      }
    }
  }
  return result;
}

namespace {

/// Marks the pixels whose centre `contains` holds, of those between the edges of `around`.
template <class Contains>
void mark(std::vector<std::uint8_t>& pixels, ImageSize size, const Rectangle& around,
          Contains contains) {
  const auto first = [](double edge, int end) {  // an edge may lie anywhere
    return static_cast<int>(std::clamp(std::floor(edge), 0.0, static_cast<double>(end)));
  };
  const int top = first(around.top, size.height);
  const int left = first(around.left, size.width);
  for (int y = top; y < size.height && y < around.bottom; ++y) {
    for (int x = left; x < size.width && x < around.right; ++x) {
      if (!contains(x, y)) continue;
      pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) +
             static_cast<std::size_t>(x)] = 1;
    }
  }
}

}  // namespace

std::vector<std::uint8_t> labelled_pixels(const VolumeLabels& labels, ImageSize size) {
  std::vector<std::uint8_t> pixels(size.pixel_count(), 0);
  for (const VolumeBox& box : labels.boxes) {
    if (box.ignore) continue;
    const Rectangle& edges = box.clipped;  // between pixels: the centre of pixel x is at x + 0.5
    mark(pixels, size, edges, [&](int x, int y) {
      return x + 0.5 >= edges.left && x + 0.5 <= edges.right && y + 0.5 >= edges.top &&
             y + 0.5 <= edges.bottom;
    });
  }
  for (const VolumePerson& person : labels.persons) {
    const Rectangle crop = pose_crop(person);  // its edges are points
    mark(pixels, size, {crop.left, crop.top, crop.right + 1, crop.bottom + 1}, [&](int x, int y) {
      return x >= crop.left && x <= crop.right && y >= crop.top && y <= crop.bottom;
    });
  }
  return pixels;
}

PairLoss pair_loss(std::span<const float> volume, std::span<const float> reference,
                   const VolumeShape& shape, std::span<const std::uint8_t> labelled) {
  PairLoss loss;
  const RealismScores scores = match_scores(volume, reference, shape);
  loss.f1_raw = scores.f1_raw;
  loss.f1_time = scores.f1_time;
  loss.time_correlation = scores.time_correlation;
  loss.relative_l2 = relative_distance(volume, reference);
  for (std::size_t i = 0; i < volume.size(); ++i) {
    loss.largest = std::max(loss.largest, std::abs(static_cast<double>(volume[i]) - reference[i]));
  }
  const std::vector<float> events = events_over_time(volume, shape);
  const std::vector<float> wanted = events_over_time(reference, shape);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (labelled[i % labelled.size()] == 0 || wanted[i] <= kEventThreshold) continue;
    ++loss.labelled_events;
    loss.lost_events += events[i] <= kEventThreshold;
  }
  return loss;
}

PairLoss overall_loss(std::span<const PairLoss> pairs) {
  PairLoss all;
  std::vector<double> distances;
  std::vector<RealismScores> scores;
  for (const PairLoss& pair : pairs) {
    distances.push_back(pair.relative_l2);
    RealismScores& score = scores.emplace_back();
    score.f1_raw = pair.f1_raw;
    score.f1_time = pair.f1_time;
    score.time_correlation = pair.time_correlation;
    all.largest = std::max(all.largest, pair.largest);
    all.labelled_events += pair.labelled_events;
    all.lost_events += pair.lost_events;
  }
  const RealismScores mean = mean_scores(scores);
  all.relative_l2 = spread_of(distances).median;
  all.f1_raw = mean.f1_raw;
  all.f1_time = mean.f1_time;
  all.time_correlation = mean.time_correlation;
  if (pairs.empty()) all.largest = std::numeric_limits<double>::quiet_NaN();
  return all;
}

double lost_share(const PairLoss& loss) {
  return loss.labelled_events > 0
             ? static_cast<double>(loss.lost_events) / static_cast<double>(loss.labelled_events)
             : std::numeric_limits<double>::quiet_NaN();
}

Spread spread_of(std::vector<double> values) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (values.empty()) return {kNone, kNone, kNone};
  std::ranges::sort(values);
  const auto at = [&](double share) {
    const double rank = share * static_cast<double>(values.size() - 1);
    const auto below = static_cast<std::size_t>(rank);
    const double along = rank - static_cast<double>(below);
    if (along == 0) return values[below];  // its neighbour may be infinite
    return values[below] * (1 - along) + values[below + 1] * along;
  };
  return {at(0.5), at(0.25), at(0.75)};
}

}  // namespace eventgan
