#pragma once

#include <string>

#include "stages/scenes/picture.h"
#include "stages/scenes/vector3.h"

namespace eventgan {

/// A car or van on the road at one moment, as KITTI describes objects: metres, camera frame.
struct Vehicle {
  std::string type;  ///< KITTI's class
  int number = 0;    ///< the same for this vehicle at all times
  double height = 0;
  double width = 0;
  double length = 0;
  Vector3 location;       ///< middle of its underside
  double rotation_y = 0;  ///< 0: its front points along x; -π/2: along z, away from the camera
  Colour paint;
};

}  // namespace eventgan
