#include "stages/generator/wanted_tiles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace eventgan {
namespace {

/// Marks the tiles that hold pixels top..bottom - 1, left..right - 1 of the image.
void want(TileMask& mask, TileMask::Pixels part) {
  part = {std::max(part.top, 0), std::min(part.bottom, mask.size.height), std::max(part.left, 0),
          std::min(part.right, mask.size.width)};
  if (part.top >= part.bottom || part.left >= part.right) return;
  const int last_row = (part.bottom - 1 + mask.origin_y) / mask.side;
  const int first_column = (part.left + mask.origin_x) / mask.side;
  const int last_column = (part.right - 1 + mask.origin_x) / mask.side;
  for (int row = (part.top + mask.origin_y) / mask.side; row <= last_row; ++row) {
    std::fill_n(mask.wanted.begin() + row * mask.columns() + first_column,
                last_column - first_column + 1, std::uint8_t{1});
  }
}

/// Marks the pixels that move, [y, x], as wanted_tiles says.
std::vector<std::uint8_t> moving_pixels(std::span<const float> frames, ImageSize size,
                                        double threshold) {
  const std::size_t pixels = size.pixel_count();
  const auto width = static_cast<std::size_t>(size.width);
  const auto least = static_cast<float>(16 * threshold / 127.5);  // the kernel's sum is 16
  const auto row_at = [&](int y) {
    return frames.data() + static_cast<std::size_t>(std::clamp(y, 0, size.height - 1)) * width;
  };
  std::vector<std::uint8_t> moves(pixels);
  std::vector<float> down(width + 2);  // smoothed along y, with a column more at each side
  for (int y = 0; y < size.height; ++y) {
    const float *above = row_at(y - 1), *here = row_at(y), *below = row_at(y + 1);
    for (std::size_t x = 0; x < width; ++x) {
      down[x + 1] = (above[x + pixels] - above[x]) + 2 * (here[x + pixels] - here[x]) +
                    (below[x + pixels] - below[x]);
    }
    down.front() = down[1];
    down.back() = down[width];
    std::uint8_t* const row = moves.data() + static_cast<std::size_t>(y) * width;
    for (std::size_t x = 0; x < width; ++x) {
      row[x] = !(std::abs(down[x] + 2 * down[x + 1] + down[x + 2]) <= least);  // NaN moves, too
    }
  }
  return moves;
}

/// A tile is wanted if a pixel that moves lies in it or near it: so each is asked for itself, until
/// one is found, which in a scene that moves is soon.
void want_motion(TileMask& mask, std::span<const float> frames, double threshold, int margin) {
  const std::vector<std::uint8_t> moves = moving_pixels(frames, mask.size, threshold);
  for (int row = 0; row < mask.rows(); ++row) {
    for (int column = 0; column < mask.columns(); ++column) {
      const TileMask::Pixels tile = mask.pixels(row, column);
      const int left = std::max(tile.left - margin, 0);
      const int right = std::min(tile.right + margin, mask.size.width);
      const int bottom = std::min(tile.bottom + margin, mask.size.height);
      for (int y = std::max(tile.top - margin, 0); y < bottom; ++y) {
        const auto begin = moves.begin() + static_cast<std::ptrdiff_t>(y) * mask.size.width;
        if (std::find(begin + left, begin + right, 1) == begin + right) continue;
        mask.wanted[static_cast<std::size_t>(row) * mask.columns() + column] = 1;
        break;
      }
    }
  }
}

/// The pixels of a rectangle, which may lie anywhere, and of its surroundings.
TileMask::Pixels around(const Rectangle& box, int margin, ImageSize volume_up_to) {
  const auto pixel = [](double edge, int most) {
    return static_cast<int>(std::clamp(edge, -1.0, static_cast<double>(most)));
  };
  return {pixel(std::floor(box.top) - margin, volume_up_to.height),
          pixel(std::ceil(box.bottom) + margin + 1, volume_up_to.height),
          pixel(std::floor(box.left) - margin, volume_up_to.width),
          pixel(std::ceil(box.right) + margin + 1, volume_up_to.width)};
}

}  // namespace

Rectangle pose_crop(const VolumePerson& person) {
  // The loaders of MPII move the centre down and enlarge the scale before they vary it.
  constexpr double kMoved_px = 15;
  constexpr double kSide_px = 200;
  constexpr double kEnlarged = 1.25;
  constexpr double kLargestVariation = 1.25;
  constexpr double kTurned = std::numbers::sqrt2;  // a square turned by 45 degrees
  constexpr double kReach_px = kSide_px / 2 * kEnlarged * kLargestVariation * kTurned;
  if (person.center != kMissingPoint && person.scale > 0) {
    const double reach = kReach_px * person.scale;
    const double y = person.center.y + kMoved_px * person.scale;
    return {person.center.x - reach, y - reach, person.center.x + reach, y + reach};
  }
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Rectangle box{kFar, kFar, -kFar, -kFar};
  for (const Point joint : person.joints) {
    if (joint == kMissingPoint) continue;
    box = {std::min(box.left, joint.x), std::min(box.top, joint.y), std::max(box.right, joint.x),
           std::max(box.bottom, joint.y)};
  }
  if (box.left > box.right) return box;
  // The scale is that of the longer side, the centre the middle, of the joints that a trainer
  // takes. If they are all that lie at one side, the crop reaches beyond it by as much as the other
  // axis asks for; if they span the axis, half of it lies between the middle and the side.
  const double width = box.right - box.left;
  const double height = box.bottom - box.top;
  const auto beyond = [](double along, double across) {
    constexpr double kReach = kReach_px / kSide_px;
    return std::max(kReach * std::max(across, 1.0),
                    kReach * std::max({along, across, 1.0}) - along / 2);
  };
  const double x = beyond(width, height);
  const double y = beyond(height, width);
  return {box.left - x, box.top - y, box.right + x, box.bottom + y};
}

TileMask wanted_tiles(const ScopeSpec& scope, std::span<const float> frames, ImageSize content,
                      int content_y, int content_x, const VolumeLabels& labels) {
  TileMask mask{content, scope.tile_px, content_y % scope.tile_px, content_x % scope.tile_px, {}};
  mask.wanted.resize(static_cast<std::size_t>(mask.rows()) * mask.columns());
  if (scope.scope != Scope::kLabelsOnly) {
    want_motion(mask, frames, scope.motion_threshold, scope.motion_margin_px);
  }
  if (scope.scope == Scope::kMotion) return mask;
  const auto want_around = [&](const Rectangle& box) {
    if (box.left > box.right) return;
    const ImageSize end{content_y + content.height, content_x + content.width};
    const TileMask::Pixels part = around(box, scope.label_margin_px, end);
    want(mask, {part.top - content_y, part.bottom - content_y, part.left - content_x,
                part.right - content_x});
  };
  for (const VolumeBox& box : labels.boxes) {
    if (!box.ignore) want_around(box.clipped);
  }
  for (const VolumePerson& person : labels.persons) want_around(pose_crop(person));
  return mask;
}

std::vector<std::uint8_t> tiles_of_volume(const TileMask& wanted, int content_y, int content_x,
                                          ImageSize volume) {
  const int side = wanted.side;
  const int columns = (volume.width + side - 1) / side;
  std::vector<std::uint8_t> tiles(static_cast<std::size_t>((volume.height + side - 1) / side) *
                                  columns);
  for (int row = 0; row < wanted.rows(); ++row) {
    std::copy_n(wanted.wanted.begin() + row * wanted.columns(), wanted.columns(),
                tiles.begin() + (content_y / side + row) * columns + content_x / side);
  }
  return tiles;
}

}  // namespace eventgan
