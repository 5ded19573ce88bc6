#include "tests/stages/generator/calibration/sample_calibration.h"

#include <cmath>

#include "manifests/counter_random.h"
#include "stages/generator/calibration/quantized_tensors.h"

namespace eventgan::testing {

Calibration sample_calibration(int base_channels, std::uint64_t seed) {
  Calibration calibration{3, "random numbers", {}};
  for (const QuantizedTensor& tensor : quantized_tensors(base_channels)) {
    const CounterRandom random = CounterRandom(seed).keyed(tensor.name);
    std::uint64_t drawn = 0;
    const auto number = [&] { return float(random.uniform(drawn++)); };
    TensorStatistics& statistics = calibration.tensors.emplace_back();
    statistics.name = tensor.name;
    for (int c = 0; c < tensor.channels; ++c) {
      statistics.highest.push_back(std::pow(10.0f, 3 * number() - 1.5f));
      statistics.mean.push_back(0.3f * number() * statistics.highest.back());
    }
    if (!tensor.leaky) continue;
    for (int c = 0; c < tensor.channels; ++c) statistics.offset.push_back(-0.02f * number());
    for (int i = 0; i < tensor.channels * tensor.channels; ++i) {
      statistics.mixing.push_back(0.04f * number() - 0.02f);
    }
  }
  return calibration;
}

}  // namespace eventgan::testing
