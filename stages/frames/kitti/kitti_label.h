#pragma once

#include <span>
#include <string>
#include <string_view>

#include "manifests/values/faults.h"
#include "manifests/values/labels.h"

namespace eventgan {

/// Car, Van, Truck, Pedestrian, Person_sitting, Cyclist, Tram, Misc, DontCare; no joints.
const LabelSchema& kitti_label_schema();

/// The class of regions to leave out.
inline constexpr int kKittiDontCare = 8;

/// Index of a class name, or -1. KITTI tracking's "Person" and KITTI raw's "Person (sitting)" are
/// Person_sitting.
int kitti_class_id(std::string_view name);

/// Which benchmark's columns a label file has.
enum class KittiColumns {
  kObject,   ///< truncated is a fraction 0..1
  kTracking  ///< frame and track id come first; truncated is a level 0, 1 or 2
};

/// The difficulty of KITTI object: that of its development kit. With h = bottom - top, easy: h ≥ 40
/// px, fully visible, truncated ≤ 0.15; moderate: h ≥ 25, at most partly occluded, ≤ 0.30; hard: h
/// ≥ 25, at most largely occluded, ≤ 0.50. None where either is unknown.
int kitti_difficulty(const Box& box);

/// One object of a label file: type, truncated, occluded (0..3), alpha, left, top, right, bottom,
/// h, w, l, x, y, z, rotation_y, and perhaps a score, which is not kept. Truncated and occluded are
/// -1 where they are unknown. Numbers are taken as they are, except that the unknown 3-D box of
/// tracking's DontCare (location, rotation_y and size, in this order) becomes Box's own.
///
/// The difficulty is that of kitti_difficulty; none for DontCare, and none in tracking.
///
/// DontCare becomes `ignore`, and so does tracking's level 2, an object to be ignored. A fault
/// reads "expected 15 columns, got 7, in WHERE".
Outcome<Box> parse_kitti_object(std::span<const std::string_view> columns, KittiColumns kind,
                                const std::string& where);

/// A whole label file of KITTI object: one object a line, blank lines passed over, `original` is
/// `text` unchanged. A fault names `path` and the line.
Outcome<Annotation> parse_kitti_label(std::string text, const std::string& path);

}  // namespace eventgan
