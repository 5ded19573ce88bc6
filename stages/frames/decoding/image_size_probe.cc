#include "stages/frames/decoding/image_size_probe.h"

#include <stdexcept>
#include <string>

#include "stages/frames/decoding/picture_file.h"
#include "stages/frames/decoding/video_window.h"

namespace eventgan {

Outcome<ImageSize> probe_image_size(const std::filesystem::path& file) {
  try {
    if (is_picture_file(file)) return picture_file_size(file);
    const auto size_of = [](const ColourView& frame) { return frame.size; };
    return VideoWindow<ImageSize>(file, 1, size_of).frame(0);
  } catch (const std::runtime_error& error) {
    return SampleFault{std::string(error.what()) + ", in " + file.string()};
  }
}

}  // namespace eventgan
