#pragma once

#include <optional>

#include "manifests/grey_image.h"
#include "manifests/image_size.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// A frame as a simulated sensor of `size` sees it: grey (ITU-R BT.601, 8 bit), scaled to cover the
/// sensor, averaging over areas when it shrinks and bilinear when it grows, cut around the centre.
/// Without a size: grey alone. No blur, which would take away the contrast that makes events.
/// Throws InputError if it cannot be resized. Thread safe.
GreyImage sensor_picture(const ColourFrame& frame, std::optional<ImageSize> size);

}  // namespace eventgan
