#include "stages/events/normalization.h"

#include <algorithm>

#include "stages/events/volume_statistics.h"

namespace eventgan {

void normalize(std::span<float> volume, float eta98) {
  if (eta98 <= 0.0f) return;
  for (float& value : volume) value = std::min(value, eta98) / eta98;
}

std::vector<float> normalized(std::vector<float> volume) {
  normalize(volume, eta98(volume));
  return volume;
}

}  // namespace eventgan
