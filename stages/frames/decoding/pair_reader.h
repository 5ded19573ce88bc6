#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"
#include "manifests/values/recently_used.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/frames/decoding/video_frames.h"

namespace eventgan {

/// Files of images that will be read soon: open, and being loaded by the system. Thread safe.
class FilesAhead {
 public:
  /// Opens the file, unless it is open here already. Of one that cannot be opened nothing is kept,
  /// nor reported: reading it says why. Beyond what may be kept open (files_to_keep_open) and
  /// kMost, the one that has waited longest is closed.
  void expect(const std::filesystem::path& file);

  /// The file, which is forgotten here; opened now if it was not expected. Throws as
  /// open_image_file.
  InputFile take(const std::filesystem::path& file);

  static constexpr std::size_t kMost = 256;

 private:
  const std::size_t most_ = files_to_keep_open(kMost);
  std::mutex mutex_;
  std::list<std::pair<std::string, InputFile>> files_;  ///< by path; the latest first
  std::unordered_map<std::string_view, std::list<std::pair<std::string, InputFile>>::iterator>
      by_path_;
};

/// Decodes frame pairs from images and videos, as FrameDecoder does, and prepares them as `spec`
/// says (prepare_frame). Pairs near each other in the plan share frames: the prepared frames used
/// last are kept, so that each is opened and decoded once. A file that changes meanwhile may be
/// seen as it was.
///
/// A still's pair (FramePair::motion) is made of its one image (MovingStill). A JPEG is decoded no
/// larger than that needs (still_reduction), and objects are cut out of it as it is decoded. Of
/// videos, besides, as many whole colour frames are kept as prepared ones; of clips' stills
/// (FramePair::poses) the last image of a file, so that it is decoded and taken apart once for all
/// of its clip.
///
/// The two frames must have one size. Thread safety: `read` may be called from several threads;
/// images are decoded in parallel, videos one frame after another under a lock.
class PairReader {
 public:
  using Settle = std::function<FramePair(const FramePair& pair, ImageSize image)>;

  /// Relative frame paths start at `base`. `pairs_under_way`: how many pairs, of those in the
  /// plan's order, may be read out of order at once. A pair reaches 6 frames back, so
  /// pairs_under_way + 6 prepared frames and a margin are kept of each video (of two videos at
  /// most): with that no video is decoded twice. Of images, whose pairs may skip frames, two for
  /// each pair under way are kept, besides those 6 and the margin.
  /// `tells_between`: a still's pair knows what is seen between its frames
  /// (PreparedPair::between), which keeps its image in memory.
  PairReader(std::filesystem::path base, ImageSpec spec, int pairs_under_way = 16,
             bool tells_between = false);

  /// A fault if a file is missing, empty, truncated, not an image, or mirrored, if the sizes
  /// differ, or if too little can be seen of a still after its motion. `still_stride`: of the video
  /// that a still is in, each so many of whose frames are taken (SourceSpec::every). `boxes`: those
  /// that FramePair::objects is of; those without an outline are cut out of the image (cut_out.h).
  /// `settle`: what a still's pair, not of a clip, is once its image's size is known;
  /// PreparedPair::settled then.
  /// `with_flow`: fills PreparedPair::flow of a still.
  Outcome<PreparedPair> read(const FramePair& pair,
                             ImageOrientation orientation = ImageOrientation::kStored,
                             std::int64_t still_stride = 1, const std::vector<Box>& boxes = {},
                             const Settle& settle = {}, bool with_flow = false) const;

  /// Has the system load the images of a pair that will be read soon, so that reading it does not
  /// wait for the disk. (Videos are read in order; the system looks ahead in these by itself.)
  void expect(const FramePair& pair,
              ImageOrientation orientation = ImageOrientation::kStored) const;

 private:
  struct Clip;  // what the pairs of a clip share

  Outcome<std::array<SharedFrame, 2>> frames(const FramePair& pair,
                                             ImageOrientation orientation) const;
  SharedFrame frame(const FrameRef& ref, ImageOrientation orientation) const;
  Outcome<SharedImage> still_image(const FrameRef& still, ImageOrientation orientation,
                                   std::int64_t stride) const;
  Outcome<StillImage> settled_image(FramePair& pair, ImageOrientation orientation,
                                    std::int64_t stride, const Settle& settle) const;
  Outcome<MovingStill> still_of_clip(const FramePair& pair, ImageOrientation orientation,
                                     std::int64_t stride, const std::vector<Box>& boxes) const;
  Outcome<PreparedPair> still(const FramePair& planned, ImageOrientation orientation,
                              std::int64_t stride, const std::vector<Box>& boxes,
                              const Settle& settle, bool with_flow) const;

  std::filesystem::path base_;
  ImageSpec spec_;
  bool tells_between_;
  std::unique_ptr<RecentlyUsed<std::string, SharedFrame>> images_;
  std::unique_ptr<RecentlyUsed<std::string, std::shared_ptr<const Clip>>> clips_;
  std::unique_ptr<FilesAhead> files_;
  FrameDecoder stills_;
  std::unique_ptr<OpenVideos<SharedFrame>> videos_;
};

}  // namespace eventgan
