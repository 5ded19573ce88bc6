#pragma once

#include "manifests/placement.h"

namespace eventgan {

/// The part of the scaled picture that lies in the volume: its size, and its top left pixel's place
/// in either.
struct VisiblePart {
  ImageSize size;
  int scaled_x = 0;
  int scaled_y = 0;
  int volume_x = 0;
  int volume_y = 0;
};

VisiblePart visible_part(const Placement& placement);

}  // namespace eventgan
