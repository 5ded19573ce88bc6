#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/video_frames.h"

namespace eventgan {

/// How the images of a dataset are taken.
inline ImageOrientation orientation_of(DatasetKind dataset) {
  return is_own(dataset) ? ImageOrientation::kUpright : ImageOrientation::kStored;
}

/// The size of an image, read from its header alone; of a video, the size of its first frame. A
/// fault names the file. Thread safe.
Outcome<ImageSize> probe_image_size(const std::filesystem::path& file,
                                    ImageOrientation orientation);

/// The range to spread (ImageSpec::range) where images of 16 bits use less than a quarter of their
/// values, as far as eight of `frames` tell: without the lowest and the highest 0.1 % of the
/// values, and with room of a quarter at either end for the images that were not looked at. None of
/// videos, of images of one value alone, and if one of those looked at has fewer bits. Paths start
/// at `base`. Thread safe.
std::optional<ValueRange> narrow_value_range(const std::vector<LabelledFrame>& frames,
                                             const std::filesystem::path& base);

/// The sizes of images and videos: what one reader has learnt of a file, the next need not learn
/// again. Thread safe.
class ImageSizes {
 public:
  /// As probe_image_size, which is asked once for each file; a fault is kept, too.
  Outcome<ImageSize> of(const std::filesystem::path& file, ImageOrientation orientation);

 private:
  std::mutex mutex_;
  std::array<std::unordered_map<std::string, Outcome<ImageSize>>, 2> kept_;  ///< by orientation
};

/// Decodes single frames of images and videos. An image that decodes only in part (a truncated
/// JPEG, a PNG with a bad checksum) is a fault, never an image with a grey rest.
///
/// Thread safety: `decode` may be called from several threads. Frames of videos are decoded one
/// after another under a lock, from the video's start (seeking is not exact), and the latest ones
/// are kept; ask for them roughly in order, since going back further starts again.
class FrameDecoder {
 public:
  static constexpr int kDefaultKeptFrames = 24;

  /// Relative frame paths start at `base`. Of each of the two videos used last, the latest
  /// `kept_frames` are kept, whatever their size.
  explicit FrameDecoder(std::filesystem::path base, int kept_frames = kDefaultKeptFrames);

  /// A fault if the file is missing, empty, truncated, not an image, or larger than
  /// kMaxImagePixels, is mirrored (decode_image_file), or if a video ends before the frame; it
  /// names the frame's path. Of a video whose frames are asked for at multiples of `video_stride`,
  /// only these are kept.
  Outcome<ColourFrame> decode(const FrameRef& frame, std::int64_t video_stride = 1,
                              ImageOrientation orientation = ImageOrientation::kStored,
                              const std::optional<ValueRange>& range = {}) const;

 private:
  std::filesystem::path base_;
  std::unique_ptr<OpenVideos<ColourFrame>> videos_;
};

}  // namespace eventgan
