#pragma once

#include <span>
#include <string>
#include <string_view>

#include "manifests/faults.h"
#include "manifests/labels.h"

namespace eventgan {

/// Car, Van, Truck, Pedestrian, Person_sitting, Cyclist, Tram, Misc, DontCare; no joints.
const LabelSchema& kitti_label_schema();

/// The class of regions to leave out.
inline constexpr int kKittiDontCare = 8;

/// Index of a class name, or -1. KITTI tracking's "Person" and KITTI raw's "Person (sitting)" are
/// Person_sitting.
int kitti_class_id(std::string_view name);

/// One object of a label file: type, truncated, occluded, alpha, left, top, right, bottom, h, w, l,
/// x, y, z, rotation_y, and perhaps a score, which is not kept. Numbers are taken as they are: in
/// KITTI tracking `truncated` is a level 0, 1, 2 rather than a fraction. DontCare becomes `ignore`.
///
/// `columns` may have `leading` columns before these (tracking: frame, track id). A fault reads
/// "expected 15 columns, got 7, in WHERE".
Outcome<Box> parse_kitti_object(std::span<const std::string_view> columns, int leading,
                                const std::string& where);

/// A whole label file of KITTI object: one object a line, blank lines passed over, `original` is
/// `text` unchanged. A fault names `path` and the line.
Outcome<Annotation> parse_kitti_label(std::string text, const std::string& path);

}  // namespace eventgan
