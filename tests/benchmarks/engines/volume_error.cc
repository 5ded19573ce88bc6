#include "tests/benchmarks/engines/volume_error.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

namespace eventgan {

VolumeError volume_error(std::span<const float> volume, std::span<const float> expected) {
  double difference_squares = 0, expected_squares = 0, largest_difference = 0, largest = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double difference = double(volume[i]) - double(expected[i]);
    difference_squares += difference * difference;
    expected_squares += double(expected[i]) * double(expected[i]);
    largest_difference = std::max(largest_difference, std::abs(difference));
    largest = std::max(largest, std::abs(double(expected[i])));
  }
  if (largest == 0) throw std::invalid_argument("expected a volume with events, got zeros");
  return {std::sqrt(difference_squares / expected_squares), largest_difference / largest};
}

}  // namespace eventgan
