#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace eventgan {

/// One frame of a sequence.
struct FrameRef {
  /// The source's root as the manifest writes it, then the path below it, with forward slashes. It
  /// is relative to the manifest's folder unless the manifest's root is absolute. For a frame of a
  /// video this is the video's path.
  std::string path;
  std::int64_t index = -1;  ///< the frame's own number in its sequence, as the dataset counts
  std::int64_t video_frame =
      -1;  ///< position in the video counted from 0; -1 if `path` is a picture
  double time_s = std::numeric_limits<double>::quiet_NaN();  ///< NaN if unknown

  bool operator==(const FrameRef& other) const {
    return path == other.path && index == other.index && video_frame == other.video_frame;
  }
};

/// Two frames of one sequence, `previous` before `next`, and the labelled frame they belong to.
struct FramePair {
  FrameRef previous;
  FrameRef next;
  int gap_frames = 0;             ///< frames from previous to next, counted in stored frames, 1..6
  std::int64_t label_index = -1;  ///< FrameRef::index of the labelled frame
  /// Where the labelled frame lies: 0 = previous frame, 1 = next frame, 0.5 = in the middle.
  double label_position = 1;

  /// NaN if either time is unknown.
  double gap_s() const { return next.time_s - previous.time_s; }
};

}  // namespace eventgan
