#pragma once

#include <array>
#include <filesystem>
#include <memory>

#include "manifests/faults.h"
#include "manifests/pairs.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// Decodes single frames of pictures and videos. A picture that decodes only in part (a truncated
/// JPEG, a PNG with a bad checksum) is a fault, never a picture with a grey rest. Pictures are
/// taken as stored: an orientation tag (EXIF) is not applied, since labels are given in stored
/// pixels.
///
/// Thread safety: `decode` may be called from several threads. Frames of videos are decoded one
/// after another under a lock, from the video's start (seeking is not exact), and the latest ones
/// are kept; ask for them roughly in order, since going back further starts anew.
class FrameDecoder {
 public:
  static constexpr int kDefaultKeptFrames = 24;

  /// Relative frame paths start at `base`. Of each of the two videos used last, the latest
  /// `kept_frames` are kept, whatever their size.
  explicit FrameDecoder(std::filesystem::path base, int kept_frames = kDefaultKeptFrames);
  ~FrameDecoder();

  /// A fault if the file is missing, empty, truncated, not a picture, or larger than
  /// kMaxPicturePixels, or if a video ends before the frame; it names the frame's path.
  Outcome<ColourFrame> decode(const FrameRef& frame) const;

  /// Both frames; the first fault, if any. Two frames of one video are decoded without other
  /// threads' frames in between, so that these cannot push the first one's neighbours out.
  Outcome<std::array<ColourFrame, 2>> decode_both(const FrameRef& first,
                                                  const FrameRef& second) const;

 private:
  class OpenVideos;
  std::filesystem::path base_;
  std::unique_ptr<OpenVideos> videos_;
};

}  // namespace eventgan
