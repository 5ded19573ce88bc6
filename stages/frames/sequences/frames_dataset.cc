#include "stages/frames/sequences/frames_dataset.h"

#include "manifests/faults.h"
#include "stages/frames/sequences/pictures_dataset.h"
#include "stages/frames/sequences/video_dataset.h"

namespace eventgan {

std::unique_ptr<Dataset> open_frames_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base) {
  const std::filesystem::path root = base / spec.root;
  std::error_code error;
  const auto status = std::filesystem::status(root, error);
  if (std::filesystem::is_directory(status)) return open_pictures_dataset(spec, base);
  if (std::filesystem::is_regular_file(status) && is_video_name(root)) {
    return open_video_dataset(spec, base);
  }
  throw InputError(
      "expected a folder of pictures, a folder of such folders, or a video (mp4, avi, mov, mkv), "
      "got " +
      std::string(std::filesystem::exists(status) ? "something else" : "nothing") + ", in " +
      root.string());
}

}  // namespace eventgan
