#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace eventgan {

/// A point in pixels, x to the right and y down. The centre of the top left pixel is (0, 0), so the
/// image covers [-0.5, width - 0.5] x [-0.5, height - 0.5].
struct Point {
  double x = 0;
  double y = 0;
  bool operator==(const Point&) const = default;
};

/// What the datasets write where a point is not known; such a point is never moved by geometry.
inline constexpr Point kMissingPoint{-1, -1};

/// No label lies farther from the image's corner, and no camera has a longer focal length: no
/// image has such pixels, so what is beyond is a slip.
inline constexpr double kFarthest_px = 1e6;

/// An upright rectangle given by its edges in pixels: an edge at x lies *between* the centres of
/// the pixels x-1 and x, so a whole image is {0, 0, width, height}.
struct Rectangle {
  double left = 0;
  double top = 0;
  double right = 0;
  double bottom = 0;
  bool operator==(const Rectangle&) const = default;
};

/// What an object covers of its image: closed rings of corners, in pixels as edges are counted (the
/// centre of pixel 3 is 3.5). A place is covered if the rings wind around it: a ring that runs
/// clockwise, as one sees it, counts one, the other way minus one, and what does not sum up to 0 is
/// covered. So parts run clockwise and may overlap, and holes run the other way.
struct Outline {
  std::vector<std::vector<Point>> rings;  ///< each of three corners or more; none: not annotated
  bool empty() const { return rings.empty(); }
  bool operator==(const Outline&) const = default;
};

/// One object as annotated, in pixels of the source image. Fields that a dataset does not have
/// hold KITTI's own values for "unknown".
struct Box {
  int class_id = 0;  ///< index into LabelSchema::class_names
  Rectangle xyxy;
  float truncation = -1;  ///< 0 whole .. 1 outside the image; -1 unknown
  int occlusion = -1;     ///< 0 visible, 1 partly, 2 largely, 3 unknown; -1 not annotated
  float alpha = -10;      ///< observation angle, rad in [-pi, pi]; -10 unknown
  /// height, width, length (m), x, y, z (m, camera frame), rotation_y (rad).
  std::array<float, 7> box3d{-1, -1, -1, -1000, -1000, -1000, -10};
  /// KITTI's: 0 easy, 1 moderate, 2 hard; -1 none of them, not known, or another dataset's.
  int difficulty = -1;
  std::int64_t track_id = -1;  ///< object's number within its sequence; -1 none
  bool ignore = false;         ///< a region to leave out of training and scoring (DontCare)
  Outline outline = {};        ///< of what is seen of the object; may reach out of the image
  bool operator==(const Box&) const = default;
};

/// A joint as annotated, in pixels of the source image; kMissingPoint if it was not annotated.
struct Joint {
  Point at = kMissingPoint;
  int visible = -1;  ///< 1 visible; 0 hidden, or not annotated; -1 annotated, visibility unknown
  bool operator==(const Joint&) const = default;
};

/// Pinhole camera in pixels: u = focal_x X/Z + centre_x, v = focal_y Y/Z + centre_y.
struct Intrinsics {
  double focal_x = 0;
  double focal_y = 0;
  double centre_x = 0;
  double centre_y = 0;
  bool operator==(const Intrinsics&) const = default;
};

/// Lens distortion as Human3.6M models it, for a point (a, b) = (X/Z, Y/Z) with r2 = a^2 + b^2:
///   d = 1 + k1 r2 + k2 r2^2 + k3 r2^3 + p1 b + p2 a,   a' = a d + p2 r2,   b' = b d + p1 r2,
/// and (a', b') goes through the pinhole camera in place of (a, b). It acts before pixels come in,
/// so scaling or cutting an image leaves it as it is. (OpenCV's model has twice this p1 b + p2 a.)
struct LensDistortion {
  double k1 = 0;
  double k2 = 0;
  double k3 = 0;
  double p1 = 0;
  double p2 = 0;
  bool operator==(const LensDistortion&) const = default;
};

/// One person as annotated, in pixels of the source image, 0-based. Human3.6M has no centres,
/// scales and boxes of its own: h36m-fetch's persons have those of their joints (derive_frame).
struct Person {
  std::vector<Joint> joints;     ///< one for each of LabelSchema::joint_names, in that order
  Point center = kMissingPoint;  ///< kMissingPoint if not annotated
  double scale = -1;             ///< as annotated (MPII: height / 200 px); -1 if not annotated
  std::optional<Rectangle> head_box;
  std::optional<Rectangle> box;  ///< Human3.6M: around the joints
  /// [J][x, y, z] in mm in the camera frame, none for a joint that is not known; empty if no joint
  /// is.
  std::vector<std::optional<std::array<double, 3>>> joints3d_mm;
  std::optional<Intrinsics> camera;
  std::optional<LensDistortion> distortion;  ///< of `camera`; none if it is not known
  bool operator==(const Person&) const = default;
};

/// How what each pixel of a volume shows of the labelled image moves from the pair's previous image
/// to its next one: by so many pixels of the volume, of stills in steps of 1/128.
struct PixelFlow {
  std::vector<float> px;            ///< [2, y, x], x first; 0 beyond the image or unknown
  std::vector<std::uint8_t> valid;  ///< [y, x] 1: seen in both images; else 0

  bool empty() const { return px.empty(); }  ///< there is no flow
  bool operator==(const PixelFlow&) const = default;
};

/// Everything a dataset says about one frame.
struct Annotation {
  /// The annotation as the dataset holds it. Text formats (KITTI): the bytes of the file,
  /// unchanged. Binary formats (.mat, .h5, .npz): every field of the entry as JSON.
  std::string original;
  std::vector<Box> boxes;
  std::vector<Person> persons;
  /// P, row-major [3][4], of the image's camera (KITTI's P2): w [u, v, 1] = P [X, Y, Z, 1], in
  /// pixels of the source image and m in the rectified frame of camera 0.
  std::optional<std::array<double, 12>> projection = {};
  /// Why boxes of it are not in `boxes`: "expected X, got Y, in PATH:LINE" each.
  std::vector<std::string> left_out = {};
  /// Where each of these stands among all boxes that the annotation has, counted from 0.
  std::vector<std::size_t> left_out_at = {};
  std::size_t of_other_classes = 0;  ///< boxes left out, since the source takes other classes
  bool is_repeat = false;  ///< of a clip's still, whose losses the clip's first frame tells
  /// What outlines in `boxes` are without: "expected X, got Y, in PATH:LINE" each.
  std::vector<std::string> outlines_mended = {};
  /// Why tracks are not in `boxes`: "expected X, got Y, in PATH" each.
  std::vector<std::string> tracks_left_out = {};
  bool operator==(const Annotation&) const = default;
};

/// What class and joint numbers mean; one for a whole source.
struct LabelSchema {
  std::vector<std::string> class_names;
  std::vector<std::string> joint_names;
  /// Of joints that a subset in common use names otherwise, that name (Human3.6M: the 17 joints),
  /// "" of the others; empty, or one for each of joint_names.
  std::vector<std::string> joint_aliases = {};
  bool operator==(const LabelSchema&) const = default;
};

/// A box in volume pixels, beside the annotation it comes from.
struct VolumeBox {
  Rectangle clipped;    ///< cut to what the volume shows of the image
  Rectangle unclipped;  ///< as mapped
  bool ignore = false;  ///< as annotated, or because a crop left nothing of the box
  Outline outline;      ///< as mapped, not cut
};

/// A person in volume pixels; joints and centre that were not annotated stay kMissingPoint.
struct VolumePerson {
  std::vector<Point> joints;
  Point center = kMissingPoint;
  double scale = -1;  ///< the annotated scale times sqrt(scale_x scale_y); -1 if not annotated
  std::optional<Rectangle> head_box;
  std::optional<Rectangle> box;
  std::optional<Intrinsics> camera;
};

/// An annotation as it lies in the volume; entries in the order of Annotation.
struct VolumeLabels {
  std::vector<VolumeBox> boxes;
  std::vector<VolumePerson> persons;
  std::optional<std::array<double, 12>> projection = {};
};

}  // namespace eventgan
