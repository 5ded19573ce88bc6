#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "manifests/values/placement.h"
#include "manifests/values/still_motion.h"
#include "stages/frames/decoding/detail/still_layers.h"
#include "stages/frames/decoding/detail/still_samples.h"

namespace eventgan {

/// A photograph in layers as the volume shows it: StillLayers::frame, made grey and resized. Each
/// pixel is sampled once where it lies in the photograph, by the kernel of the motion and that of
/// the resizing in one, so that nothing is rendered in the photograph's size. It differs from that
/// frame by rounding, by as much as the kernel of the resizing does not turn and grow with the
/// motion, and a little more at the edges of what moves.
class ScaledLayers {
 public:
  /// `layers` must outlive it. `placement` is of the part of the photograph that begins at
  /// `origin`; where `layers` are of a reduced photograph, of the whole one. `resting`: the frame
  /// (grey, resized) of all that rests, if the background does: it is taken where nothing moves.
  /// Else empty, and all is sampled.
  ScaledLayers(const StillLayers& layers, const Placement& placement, cv::Point origin,
               int reduced_by = 1, cv::Mat resting = {});

  /// The frame: [y, x] uint8 of placement.scaled; maps as StillLayers::frame has them, and what is
  /// said to rest has none. Thread safe.
  cv::Mat frame(const AffineMap& background, const std::vector<AffineMap>& objects) const;

 private:
  /// Of one of StillLayers::layers.
  struct Planes {
    SampledPlane covering;  ///< grey levels times what it covers
    SampledPlane cover;     ///< how much of what is behind it cannot be seen, 255 all of it
  };
  /// The columns or the rows of the resized frame in the photograph, each made of two pixels.
  struct Axis {
    std::vector<double> place_px;      ///< of the first of the two
    std::vector<int> share;            ///< of the second, in 1/2048
    std::vector<std::int32_t> shares;  ///< of both, the second's in the upper half
  };
  class Sampler;

  static Axis axis(double begin, double cut, int scaled);
  cv::Rect seen_in(const StillLayers::Layer& layer, const AffineMap& map) const;

  const StillLayers& layers_;
  Axis columns_, rows_;
  int half_level_;  ///< of a row, to round with
  cv::Mat resting_;
  std::optional<SampledPlane> background_;
  std::vector<Planes> planes_;
};

}  // namespace eventgan
