#pragma once

#include <vector>

#include "manifests/grey_image.h"

namespace eventgan {

/// The intensity a simulated sensor sees for a picture: u/255, [y, x] float32 in [0, 1], C order.
/// Grey values are taken for linear intensity, as ESIM and v2e take them: a camera's gamma is not
/// undone, so contrasts are those of the picture as it is stored. Throws std::invalid_argument if
/// the picture is empty or its size and pixels disagree. Thread safe.
std::vector<float> linear_intensity(const GreyImage& picture);

}  // namespace eventgan
