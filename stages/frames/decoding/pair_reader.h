#pragma once

#include <filesystem>
#include <vector>

#include "manifests/faults.h"
#include "manifests/job_manifest.h"
#include "manifests/pairs.h"
#include "manifests/placement.h"
#include "stages/frames/decoding/frame_decoder.h"

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

/// Decodes frame pairs from pictures and videos and prepares them as `spec` says: grey (ITU-R
/// BT.601, 8 bit), bilinear resizing, Gaussian blur (OpenCV's 8-bit filters, sigma from the
/// kernel's side), cut, [-1, 1].
///
/// The two frames must have one size. Thread safety: `read` may be called from several threads; for
/// videos see FrameDecoder.
class PairReader {
 public:
  /// Relative frame paths start at `base`. `pairs_under_way`: how many pairs, of those in the
  /// plan's order, may be read out of order at once. A pair reaches 6 frames back, so
  /// pairs_under_way + 6 frames and a margin are kept of each video (of two videos at most),
  /// whatever the frames' size: with that no video is decoded twice.
  PairReader(std::filesystem::path base, ImageSpec spec, int pairs_under_way = 16);

  /// A fault if a file is missing, empty, truncated, not a picture, or the sizes differ.
  Outcome<PreparedPair> read(const FramePair& pair) const;

 private:
  FrameDecoder decoder_;
  ImageSpec spec_;
};

}  // namespace eventgan
