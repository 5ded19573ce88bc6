#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"

namespace eventgan {

// Labels as YOLO's and COCO's trainers read them. Rectangles are in volume pixels by their edges (a
// whole volume is 0, 0, width, height), points by pixel centres, as shards have them. Lines are
// without line ends. All thread safe.

/// "class xc yc w h": centre and size as shares of the volume's width and height, 9 decimals, each
/// within 0..1. `box` lies within the volume.
std::string yolo_line(int class_number, const Rectangle& box, ImageSize volume);

/// "class x1 y1 x2 y2 ...": the corners as shares of the volume's width and height, 9 decimals,
/// each within 0..1. It is one ring, as YOLO has it: from each of the outline's rings a bridge
/// without width leads to the next one and back, so that a reader that fills by turns (even-odd)
/// covers what the outline does; one whose parts overlap, or one itself, is that of its mask.
/// `outline` lies within the volume and is not empty.
std::string yolo_outline_line(int class_number, const Outline& outline, ImageSize volume);

/// A joint of an exported person.
struct ExportedJoint {
  Point at = kMissingPoint;  ///< volume pixels; kMissingPoint if not annotated
  int visible = -1;          ///< as Joint::visible
};

/// Whether a joint is annotated and lies in the volume, from edge to edge.
bool is_within(const ExportedJoint& joint, ImageSize volume);

/// yolo_line and then "x y v" of each joint: shares of width and height, 9 decimals, counted from
/// the volume's left and top edge, within 0..1; v 0 not annotated or outside the volume (then
/// x = y = 0), 1 hidden, 2 visible or not known.
std::string yolo_pose_line(int class_number, const Rectangle& box,
                           const std::vector<ExportedJoint>& joints, ImageSize volume);

/// Where each joint is in a mirrored image, by the joints' names: those of one side ("r_knee",
/// "RightKnee", "RKnee", "knee_right") change places with the other side's. None if a name of one
/// side has no counterpart, or no name tells a side: then the names do not say how to mirror.
std::optional<std::vector<int>> flip_indices(const std::vector<std::string>& joint_names);

/// data.yaml of `names` (number i is names[i]) and of the splits' lists, SPLIT.txt each. It has no
/// `path`: so Ultralytics begins at the file's own folder, wherever it is started. Without a split
/// val, which its trainer needs, that is train's list.
std::string yolo_data_yaml(const std::vector<std::string>& names, int channels,
                           const std::vector<std::string>& splits);

/// The same of persons, "person" the only class: with kpt_shape, kpt_names, and flip_idx if the
/// names tell it.
std::string yolo_pose_yaml(const std::vector<std::string>& joint_names, int channels,
                           const std::vector<std::string>& splits);

/// An entry of COCO's `images`.
std::string coco_image(std::int64_t id, const std::string& file_name, ImageSize volume,
                       const std::string& sample_id);

/// What a box and a person have in common in COCO's `annotations`.
struct CocoPlace {
  std::int64_t id = 0;
  std::int64_t image_id = 0;
  int category_id = 0;
};

/// An entry for a box: `bbox` is left, top, width, height. Without an outline, `area` is that of
/// the box. With one, which lies within the volume, `area` is the number of pixels that it covers,
/// and `segmentation` its parts as polygons, or the mask as compressed run lengths where it has
/// holes, a part that overlaps itself, or is a crowd's.
std::string coco_box(const CocoPlace& place, const Rectangle& box, bool is_crowd,
                     const Outline& outline, ImageSize volume);

/// An entry for a person: COCO counts an image from its left edge, so each joint is moved by half
/// a pixel; visibility 0 not annotated or outside the volume (then x = y = 0), 1 hidden, 2 visible
/// or not known.
std::string coco_person(const CocoPlace& place, const Rectangle& box, bool is_crowd,
                        const std::vector<ExportedJoint>& joints, ImageSize volume);

/// An entry of `categories`.
std::string coco_category(int id, const std::string& name);

/// The same of persons; `limbs`: pairs of joints counted from 0, which COCO counts from 1.
std::string coco_person_category(int id, const std::string& name,
                                 const std::vector<std::string>& joint_names,
                                 const std::vector<std::pair<int, int>>& limbs);

}  // namespace eventgan
