#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <vector>

#include "manifests/faults.h"
#include "manifests/job_manifest.h"
#include "manifests/pairs.h"
#include "manifests/placement.h"
#include "stages/frames/decoding/open_videos.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/frames/decoding/shared_pictures.h"

namespace eventgan {

/// Two frames, ready for the generator.
struct PreparedPair {
  /// [frame, y, x] float32, C order; frame 0 = previous, 1 = next; x = (u/255 - 0.5) * 2 in [-1,
  /// 1]. Only the visible part of the picture: with letterbox the borders are left out (no scene
  /// there, no work, no events), with crop what is cut away.
  std::vector<float> input;
  ImageSize content;  ///< size of each frame in `input`
  int content_x = 0;  ///< where `input`'s top left pixel lies in the volume
  int content_y = 0;
  Placement placement;
};

/// Decodes frame pairs from pictures and videos, as FrameDecoder does, and prepares them as `spec`
/// says (prepare_frame). Pairs near each other in the plan share frames: the prepared frames used
/// last are kept, so that each is decoded once. A file that changes meanwhile may be seen as it
/// was.
///
/// The two frames must have one size. Thread safety: `read` may be called from several threads;
/// pictures are decoded in parallel, videos one frame after another under a lock.
class PairReader {
 public:
  /// Relative frame paths start at `base`. `pairs_under_way`: how many pairs, of those in the
  /// plan's order, may be read out of order at once. A pair reaches 6 frames back, so
  /// pairs_under_way + 6 prepared frames and a margin are kept of each video (of two videos at
  /// most): with that no video is decoded twice. Of pictures, whose pairs may skip frames, two for
  /// each pair under way are kept, besides those 6 and the margin.
  PairReader(std::filesystem::path base, ImageSpec spec, int pairs_under_way = 16);

  /// A fault if a file is missing, empty, truncated, not a picture, or the sizes differ.
  Outcome<PreparedPair> read(const FramePair& pair) const;

 private:
  Outcome<std::array<SharedFrame, 2>> frames(const FramePair& pair) const;
  SharedFrame frame(const FrameRef& ref) const;

  std::filesystem::path base_;
  ImageSpec spec_;
  std::unique_ptr<SharedPictures> pictures_;
  std::unique_ptr<OpenVideos<SharedFrame>> videos_;
};

}  // namespace eventgan
