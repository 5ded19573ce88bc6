#include "stages/frames/decoding/visible_part.h"

#include <algorithm>

namespace eventgan {

VisiblePart visible_part(const Placement& placement) {
  VisiblePart part;
  part.scaled_x = std::max(0, -placement.offset_x);
  part.scaled_y = std::max(0, -placement.offset_y);
  part.volume_x = std::max(0, placement.offset_x);
  part.volume_y = std::max(0, placement.offset_y);
  part.size.height =
      std::min(placement.scaled.height - part.scaled_y, placement.volume.height - part.volume_y);
  part.size.width =
      std::min(placement.scaled.width - part.scaled_x, placement.volume.width - part.volume_x);
  return part;
}

}  // namespace eventgan
