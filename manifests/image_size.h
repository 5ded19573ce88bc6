#pragma once

#include <cstddef>

namespace eventgan {

/// Size of a picture or a volume in pixels; always height first, as arrays are laid out.
struct ImageSize {
  int height = 0;
  int width = 0;

  bool operator==(const ImageSize&) const = default;
  std::size_t pixel_count() const {
    return static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  }
};

}  // namespace eventgan
