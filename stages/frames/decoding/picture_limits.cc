#include "stages/frames/decoding/picture_limits.h"

#include <stdexcept>
#include <string>

namespace eventgan {

void check_picture_size(ImageSize size) {
  if (size.height > 0 && size.width > 0 && size.pixel_count() <= kMaxPicturePixels) return;
  throw std::runtime_error("a size of " + std::to_string(size.width) + "x" +
                           std::to_string(size.height) + ", not 1 to " +
                           std::to_string(kMaxPicturePixels) + " pixels");
}

}  // namespace eventgan
