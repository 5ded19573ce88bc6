#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan {

/// `images.txt` of an ECD recording: a line "t path" for each frame.
struct EcdImageList {
  std::vector<double> times_s;     ///< strictly ascending
  std::vector<std::string> paths;  ///< relative to the recording's folder, as written
};

/// Throws InputError "expected X, got Y, in FILE (line 3)", the line counted from 1.
EcdImageList read_ecd_image_list(const std::filesystem::path& file);

}  // namespace eventgan
