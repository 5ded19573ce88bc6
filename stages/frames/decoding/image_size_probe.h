#pragma once

#include <filesystem>

#include "manifests/faults.h"
#include "manifests/image_size.h"

namespace eventgan {

/// The size of a picture as stored, read from its header alone (PNG, JPEG); other formats are
/// decoded. For a video, the size of its first frame. A fault names the file. Thread safe.
Outcome<ImageSize> probe_image_size(const std::filesystem::path& file);

}  // namespace eventgan
