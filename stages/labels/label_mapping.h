#pragma once

#include <string>

#include "manifests/faults.h"
#include "manifests/labels.h"
#include "manifests/placement.h"
#include "manifests/volume_labels.h"

namespace eventgan {

/// Maps every label into the volume. A fault if a label cannot belong to the picture: a number that
/// is not finite, as annotated or in the volume (a joint in 3-D may be unknown), a box with right <
/// left or bottom < top or without any overlap with the source picture (a box to ignore may lie
/// anywhere), a person whose annotated joints all lie outside it. `where` names the annotation in
/// the fault.
Outcome<VolumeLabels> map_labels(const Annotation& annotation, const Placement& placement,
                                 const std::string& where);

}  // namespace eventgan
