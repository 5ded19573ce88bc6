#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/events.h"

namespace eventgan {

struct NamedVolume {
  std::string name;           ///< below its image
  std::vector<float> volume;  ///< [2 bins, y, x] float32, ≥ 0
};

/// A pair of frames with volumes to compare. All of one size.
struct ComparedPair {
  VolumeShape shape;
  std::vector<float> frames;         ///< [frame, y, x] float32, previous then next, in [-1, 1]
  std::vector<NamedVolume> volumes;  ///< at least one
  std::string title;                 ///< one line above the row
};

/// Draws a row for each pair: previous frame | next frame | each volume as average-timestamp
/// image, coloured as write_preview_png says | the volumes' events a bin, Σ over both polarities,
/// as lines from zero to the largest; images enlarged by whole factors where small. Writes a PNG.
/// Throws std::runtime_error naming the path if it cannot be written; std::invalid_argument for no
/// pair, no volume, or sizes that do not fit each other. Thread safe.
void write_comparison_png(std::span<const ComparedPair> pairs, const std::filesystem::path& path);

}  // namespace eventgan
