#include "pipeline/calibration/volume_distance.h"

#include <cmath>
#include <cstddef>
#include <limits>

namespace eventgan {

double relative_distance(std::span<const float> volume, std::span<const float> reference) {
  double difference = 0;
  double whole = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const double r = reference[i];
    const double d = volume[i] - r;
    difference += d * d;
    whole += r * r;
  }
  if (whole > 0) return std::sqrt(difference / whole);
  return difference == 0 ? 0 : std::numeric_limits<double>::infinity();
}

}  // namespace eventgan
