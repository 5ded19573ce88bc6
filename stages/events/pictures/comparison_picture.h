#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/events.h"

namespace eventgan {

/// A pair of frames with two volumes to compare. All of one size.
struct ComparedPair {
  VolumeShape shape;
  std::vector<float> frames;     ///< [frame, y, x] float32, previous then next, in [-1, 1]
  std::vector<float> generated;  ///< [2 bins, y, x] float32, ≥ 0
  std::vector<float> real;       ///< [2 bins, y, x] float32, ≥ 0
  std::string title;             ///< one line above the row
};

/// Draws a row for each pair: previous frame | next frame | generated | real, the volumes as
/// average-timestamp pictures coloured as write_preview_png says, enlarged by whole factors where
/// small; and writes a PNG. Throws std::runtime_error naming the path if it
/// cannot be written; std::invalid_argument for no pair or sizes that do not fit each other. Thread
/// safe.
void write_comparison_png(std::span<const ComparedPair> pairs, const std::filesystem::path& path);

}  // namespace eventgan
