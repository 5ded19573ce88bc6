#include "tests/testing/fake_generator.h"

#include <algorithm>
#include <limits>

namespace eventgan::testing {

GenerationNotes FakeGenerator::generate(const GeneratorInput& pair, std::span<float> volume) const {
  ++calls_;
  threshold_ = pair.threshold ? pair.threshold->mean : 0;
  const auto& frames = pair.frames;
  ContrastThreshold sensor{1};
  if (thresholds_)
    sensor = pair.threshold.value_or(ContrastThreshold{thresholds_->geometric_mean()});
  const std::size_t plane = pair.size.pixel_count();
  for (int bin = 0; bin < bins_; ++bin) {
    const float weight = float(bin + 1) / float(bins_);
    for (std::size_t i = 0; i < plane; ++i) {
      const float change = frames[plane + i] - frames[i];
      volume[bin * plane + i] = std::max(change, 0.0f) * weight / float(sensor.positive());
      volume[(bins_ + bin) * plane + i] =
          std::max(-change, 0.0f) * weight / float(sensor.negative());
    }
  }
  if (frames[0] == failing_value_) volume[0] = std::numeric_limits<float>::quiet_NaN();
  return {saturated_share_};
}

}  // namespace eventgan::testing
