#pragma once

#include <filesystem>
#include <string>

#include "manifests/values/faults.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// What a pixel of motion counts in the numbers of a benchmark's image of flow.
inline constexpr double kKittiFlowSteps = 64;
inline constexpr double kDsecFlowSteps = 128;

/// Optical flow as KITTI's and DSEC's benchmarks store it: a PNG of 16 bits a channel, red and
/// green 2^15 + steps · (x, y), blue 1 where it is known. `place`: SourceFlow::place. Throws
/// std::runtime_error "expected X, got Y, in PLACE". Thread safe.
SourceFlow read_flow_image(const std::filesystem::path& file, const std::string& place,
                           double steps_per_px);

/// A labelled frame's ground truth (Dataset::flow) in the volume: of each pixel that of the
/// source's nearest one (between known and unknown pixels nothing is to be interpolated), in pixels
/// of the volume, at most float16's largest. Valid where the source's is, and it leads to a place
/// between the outermost pixels' centres of what the volume shows. Empty where Dataset::flow knows
/// none; a fault if it has one, or another size than the placement's source. Thread safe.
Outcome<PixelFlow> true_flow(const Dataset& dataset, const std::string& label_key,
                             const Placement& placement);

}  // namespace eventgan
