#include "stages/frames/decoding/image_size_probe.h"

#include <stdexcept>
#include <string>

#include "stages/frames/decoding/picture_file.h"
#include "stages/frames/decoding/video_file.h"

namespace eventgan {

Outcome<ImageSize> probe_image_size(const std::filesystem::path& file) {
  try {
    return is_picture_file(file) ? picture_file_size(file) : VideoFile(file, 1).frame(0).size;
  } catch (const std::runtime_error& error) {
    return SampleFault{std::string(error.what()) + ", in " + file.string()};
  }
}

}  // namespace eventgan
