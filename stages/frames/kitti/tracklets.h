#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {

/// One object in one frame of a tracklet_labels.xml.
struct TrackletPose {
  std::int64_t track = 0;                    ///< place in the file, from 0
  int class_id = 0;                          ///< index into kitti_label_schema().class_names
  double height = 0, width = 0, length = 0;  ///< m, above 0
  double x = 0, y = 0, z = 0;  ///< the middle of its underside, m, in the scanner's frame
  double rotation_z = 0;       ///< rad about the scanner's z; at 0 its length lies along x
  int occlusion = -1;          ///< 0 visible, 1 partly, 2 largely; -1 not annotated
  int truncation = -1;  ///< 0 inside the image, 1 cut, 2 outside, 99 behind the camera; -1 unset
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

/// A point in metres.
using Point3 = std::array<double, 3>;

/// How the laser scanner's points come to lie in the rectified left colour image, by KITTI raw's
///   x_rect = R_rect_00 (R x_velo + T),    (u, v, 1) ~ P_rect_02 (x_rect, 1).
/// The scanner's x points forward, y left, z up; the rectified camera's x right, y down, z forward.
struct RawCalibration {
  std::array<double, 9> rotation{};       ///< R, row-major
  Point3 translation{};                   ///< T, m
  std::array<double, 9> rectification{};  ///< R_rect_00, row-major
  std::array<double, 12> projection{};    ///< P_rect_02, row-major [3][4]
  ImageSize image;                        ///< S_rect_02

  Point3 to_rectified(const Point3& velodyne) const;

  /// In pixels; `rectified` must lie before the camera.
  Point project(const Point3& rectified) const;
};

/// Reads DATE/calib_velo_to_cam.txt and DATE/calib_cam_to_cam.txt; nothing unless both are there.
/// Throws InputError if one lacks a key or has another number of values than it should.
std::optional<RawCalibration> read_raw_calibration(const SourceRoot& root, const std::string& date);

/// The tracklet as KITTI object would annotate it: the smallest upright rectangle around what the
/// camera sees of its cuboid, cut at 0 and at the last pixel's centre (width - 1, height - 1),
/// where KITTI's own labels end; box3d with the middle of the underside in the rectified frame.
/// Nothing if it lies behind the camera or outside the image. `truncation` is 0 if the annotators
/// marked it as inside the image, else unknown.
std::optional<Box> to_box(const TrackletPose& pose, const RawCalibration& calibration);

}  // namespace eventgan
