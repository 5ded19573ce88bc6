#pragma once

#include <cstddef>

#include "manifests/labels.h"

namespace eventgan {

inline constexpr std::size_t kMpiiJointCount = 16;

/// MPII's joints by their id in the .mat file, which is also their place in the JSON lists and
/// tables: right ankle, knee, hip, left hip, knee, ankle, pelvis, thorax, upper neck, head top,
/// right wrist, elbow, shoulder, left shoulder, elbow, wrist ("r_ankle" ..). Left and right are the
/// person's. No classes.
const LabelSchema& mpii_label_schema();

}  // namespace eventgan
