#include "stages/generator/calibration/calibration.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "stages/generator/calibration/quantized_tensors.h"

namespace eventgan {
namespace {

bool all_finite(const std::vector<float>& values) {
  return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

bool none_negative(const std::vector<float>& values) {
  return std::ranges::all_of(values, [](float value) { return value >= 0; });
}

void check_tensor(const TensorStatistics& got, const QuantizedTensor& tensor,
                  const std::string& name) {
  const auto fail = [&](const std::string& expected, const std::string& instead) {
    throw std::runtime_error("expected " + expected + " for " + tensor.name + ", got " + instead +
                             ", in " + name);
  };
  if (got.name != tensor.name) fail("statistics", "some for \"" + got.name + "\"");
  const std::size_t channels = tensor.channels;
  const std::size_t guessed = tensor.leaky ? channels : 0;
  for (const auto& [values, count] : {std::pair{&got.highest, channels},
                                      {&got.mean, channels},
                                      {&got.offset, guessed},
                                      {&got.mixing, guessed * guessed}}) {
    if (values->size() != count) {
      fail(std::to_string(count) + " values", std::to_string(values->size()));
    }
    if (!all_finite(*values)) fail("finite numbers", "NaN or infinity");
  }
  if (!none_negative(got.highest) || !none_negative(got.mean)) {
    fail("a highest value and a mean of at least 0", "a negative number");
  }
}

}  // namespace

void check_calibration(const Calibration& calibration, int base_channels, const std::string& name) {
  if (calibration.pairs < 1) {
    throw std::runtime_error("expected a calibration from at least 1 pair, got " +
                             std::to_string(calibration.pairs) + ", in " + name);
  }
  const std::vector<QuantizedTensor> tensors = quantized_tensors(base_channels);
  if (calibration.tensors.size() != tensors.size()) {
    throw std::runtime_error("expected " + std::to_string(tensors.size()) +
                             " calibrated tensors, got " +
                             std::to_string(calibration.tensors.size()) + ", in " + name);
  }
  for (std::size_t i = 0; i < tensors.size(); ++i) {
    check_tensor(calibration.tensors[i], tensors[i], name);
  }
}

}  // namespace eventgan
