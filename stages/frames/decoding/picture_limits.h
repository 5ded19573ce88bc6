#pragma once

#include "manifests/image_size.h"

namespace eventgan {

/// A header may announce any size; pictures beyond this many pixels are refused before memory is
/// taken for them.
inline constexpr std::size_t kMaxPicturePixels = std::size_t{1} << 26;

/// Throws std::runtime_error ("a size of WxH, not 1 to N pixels") if the size is empty or beyond
/// the limit.
void check_picture_size(ImageSize size);

}  // namespace eventgan
