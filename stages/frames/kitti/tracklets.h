#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "manifests/faults.h"

namespace eventgan {

/// One object in one frame of a tracklet_labels.xml.
struct TrackletPose {
  std::int64_t track = 0;                    ///< place in the file, from 0
  int class_id = 0;                          ///< index into kitti_label_schema().class_names
  double height = 0, width = 0, length = 0;  ///< m, above 0
  double x = 0, y = 0, z = 0;  ///< the middle of its underside, m, in the scanner's frame
  double rotation_z = 0;       ///< rad about the scanner's z; at 0 its length lies along x
  int occlusion = -1;          ///< 0 visible, 1 partly, 2 largely; -1 not annotated
  int truncation = -1;  ///< 0 inside the picture, 1 cut, 2 outside, 99 behind the camera; -1 unset
};

/// Everything the file says about one frame.
struct TrackletFrame {
  std::vector<TrackletPose> poses;  ///< in the file's order
  /// A JSON array, one object a tracklet: "track", every field of the tracklet, and "pose" with its
  /// "frame" and every field of the pose. Numbers are JSON numbers, anything else is text.
  std::string json;
};

/// A tracklet_labels.xml of KITTI raw, held in memory; thread-safe.
class Tracklets {
 public:
  /// `path` is for messages. Throws InputError if it is not such a file, a tracklet's first_frame
  /// is not a frame's number, or there are not as many tracklets or poses as <count> says.
  Tracklets(const std::string& xml, std::string path);
  ~Tracklets();
  Tracklets(Tracklets&&) noexcept;

  /// Frames with at least one tracklet, ascending.
  std::vector<std::int64_t> frames() const;

  /// A frame without tracklets has no poses and the JSON "[]". A fault names the file and the
  /// tracklet.
  Outcome<TrackletFrame> frame(std::int64_t number) const;

 private:
  struct Document;
  std::unique_ptr<Document> document_;
};

}  // namespace eventgan
