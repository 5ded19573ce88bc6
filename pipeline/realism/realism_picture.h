#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "pipeline/realism/real_interval.h"

namespace eventgan {

/// A method's volume [2 bins, y, x] float32, and the method's name.
struct NamedVolume {
  std::string method;
  std::vector<float> volume;
};

/// Writes FIRST-LAST.png (six digits each) into `folder`, which must exist: a row for each method,
/// previous frame | next frame | the method's | real, both volumes normalised
/// as they are compared. Nothing for no methods. Throws std::runtime_error if it cannot be written.
void write_realism_picture(const RealInterval& real, std::span<const NamedVolume> volumes, int bins,
                           const std::filesystem::path& folder);

}  // namespace eventgan
