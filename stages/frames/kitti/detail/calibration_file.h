#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/listing/source_folders.h"

namespace eventgan {

/// One of KITTI's calibration files: lines "KEY: number number ...", in object and tracking
/// calib/ID.txt, in raw calib_cam_to_cam.txt and calib_velo_to_cam.txt.
class CalibrationFile {
 public:
  /// Throws InputError if the file cannot be read.
  CalibrationFile(const SourceRoot& root, const std::string& relative);

  /// The numbers of a key. Throws InputError if it is missing, has not N numbers, or one that is
  /// not finite, or if they are a matrix (9 or 12 of them) without full rank.
  template <std::size_t N>
  std::array<double, N> read(std::string_view key) const {
    std::array<double, N> values;
    std::ranges::copy(numbers(key, N), values.begin());
    return values;
  }

 private:
  std::vector<double> numbers(std::string_view key, std::size_t count) const;

  std::string text_;
  std::string path_;
};

}  // namespace eventgan
