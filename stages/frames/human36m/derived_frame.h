#pragma once

#include <vector>

#include "manifests/values/labels.h"

namespace eventgan {

/// A person annotated by joints alone: [joint, (x, y)] in px and [joint, (x, y, z)] in mm in the
/// camera's frame (empty: unknown). Nothing says what is visible. Centre, scale and box as
/// derive_frame gives them.
Person person_of_joints(const std::vector<double>& joints, const std::vector<double>& joints3d_mm);

/// Centre, scale and box of a person that is annotated by joints alone, by the rule that pose
/// trainers use on Human3.6M (Kolotouros et al. 2019, SPIN): the box holds all annotated joints,
/// the centre is its middle, the scale 1.2 times its longer side over 200 px. Nothing without
/// annotated joints.
void derive_frame(Person& person);

/// The same, but only the box: for persons that have a centre and a scale.
void derive_box(Person& person);

}  // namespace eventgan
