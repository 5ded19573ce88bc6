#pragma once

#include "manifests/image_size.h"
#include "manifests/labels.h"
#include "stages/scenes/road/vehicle_shape.h"

namespace eventgan {

/// Around all of a vehicle that lies before the camera, as edges in px; may pass the picture's
/// border, and is empty (left > right) for a vehicle behind the camera.
Rectangle whole_outline(const VehicleShape& shape, const Intrinsics& camera);

/// Around what a picture of this size shows of the vehicle, were nothing before it: exact also at
/// the picture's border, where it may be smaller than the part of the whole outline that lies
/// within.
Rectangle visible_outline(const VehicleShape& shape, const Intrinsics& camera, ImageSize picture);

}  // namespace eventgan
