#pragma once

#include <cstdint>
#include <vector>

#include "manifests/placement.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// A colour picture laid into the volume's frame as the generator's input was (same resizing, same
/// cut, borders black): [y, x, channel] uint8 of size placement.volume, channels blue, green, red.
/// For looking at, not for the network. Throws std::invalid_argument if the frame's size is not the
/// placement's source. Thread safe.
std::vector<std::uint8_t> place_colour(const ColourFrame& frame, const Placement& placement);

}  // namespace eventgan
