#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "manifests/values/frames.h"

namespace eventgan {

/// Which square tiles of an image are wanted. Tile (r, c) holds rows r side - origin_y up to
/// (r + 1) side - origin_y, as far as the image goes, and columns likewise, so that the tiles of
/// an image within a larger one lie on the larger one's grid.
struct TileMask {
  ImageSize size;    ///< of the image
  int side = 16;     ///< of a tile, pixels
  int origin_y = 0;  ///< rows of the first tile that lie before the image, 0..side-1
  int origin_x = 0;
  std::vector<std::uint8_t> wanted;  ///< [row, column] 1 or 0

  int rows() const { return (size.height + origin_y + side - 1) / side; }
  int columns() const { return (size.width + origin_x + side - 1) / side; }
  bool is_wanted(int row, int column) const {
    return wanted[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns()) +
                  static_cast<std::size_t>(column)] != 0;
  }

  /// A tile's pixels.
  struct Pixels {
    int top, bottom, left, right;  ///< the first, and the one after the last
  };
  Pixels pixels(int row, int column) const {
    return {std::max(row * side - origin_y, 0), std::min((row + 1) * side - origin_y, size.height),
            std::max(column * side - origin_x, 0),
            std::min((column + 1) * side - origin_x, size.width)};
  }

  /// Calls visit(Pixels) for each tile that is wanted (or is not), row by row.
  template <class Visit>
  void visit_tiles(bool wanted_ones, Visit&& visit) const {
    for (int row = 0; row < rows(); ++row) {
      for (int column = 0; column < columns(); ++column) {
        if (is_wanted(row, column) == wanted_ones) visit(pixels(row, column));
      }
    }
  }

  /// The same for the wanted tiles' parts in a rectangle of the image, not empty.
  template <class Visit>
  void visit_within(const Pixels& part, Visit&& visit) const {
    for (int row = (part.top + origin_y) / side; row * side - origin_y < part.bottom; ++row) {
      for (int column = (part.left + origin_x) / side; column * side - origin_x < part.right;
           ++column) {
        if (!is_wanted(row, column)) continue;
        const Pixels tile = pixels(row, column);
        visit(Pixels{std::max(tile.top, part.top), std::min(tile.bottom, part.bottom),
                     std::max(tile.left, part.left), std::min(tile.right, part.right)});
      }
    }
  }
};

}  // namespace eventgan
