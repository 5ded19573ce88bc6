#include "stages/events/pictures/panel_scale.h"

#include <algorithm>

namespace eventgan {

PanelScale panel_scale(ImageSize volume) {
  constexpr int kPanelSide = 720;
  constexpr int kLargest = 8;
  const int longest = std::max({volume.height, volume.width, 1});
  return {std::clamp(kPanelSide / longest, 1, kLargest)};
}

}  // namespace eventgan
