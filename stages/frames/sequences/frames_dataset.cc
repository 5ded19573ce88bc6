#include "stages/frames/sequences/frames_dataset.h"

#include <algorithm>
#include <string>

#include "manifests/values/faults.h"
#include "stages/frames/sequences/image_folder.h"

namespace eventgan {

std::unique_ptr<Dataset> open_frames_dataset(const SourceSpec& spec,
                                             const std::filesystem::path& base) {
  const std::filesystem::path root = base / spec.root;
  std::error_code error;
  const auto status = std::filesystem::status(root, error);
  if (std::filesystem::is_directory(status)) {
    const ImageFolder top = list_image_folder(root);
    const bool has_videos = std::ranges::any_of(top.left_out, is_video_name);
    return top.frames.empty() && has_videos ? open_videos_dataset(spec, base)
                                            : open_images_dataset(spec, base);
  }
  if (std::filesystem::is_regular_file(status) && is_video_name(root)) {
    return open_videos_dataset(spec, base);
  }
  throw InputError(
      "expected a video (mp4, avi, mov, mkv), a folder of images, of such folders, or of "
      "videos, got " +
      std::string(std::filesystem::exists(status) ? "something else" : "nothing") + ", in " +
      root.string());
}

}  // namespace eventgan
