#pragma once

#include <span>

#include "manifests/image_size.h"

namespace eventgan {

/// Throws std::invalid_argument "expected frames [2, H, W] and a volume [2 bins, H, W] of ..., got
/// ..." unless the spans are what Generator::generate takes for this size.
void check_generator_spans(std::span<const float> frames, ImageSize size,
                           std::span<const float> volume, int bins);

}  // namespace eventgan
