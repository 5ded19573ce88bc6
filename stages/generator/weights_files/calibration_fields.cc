#include "stages/generator/weights_files/calibration_fields.h"

#include <limits>
#include <stdexcept>

#include "stages/generator/calibration/quantized_tensors.h"
#include "stages/generator/weights_files/content_fields.h"

namespace eventgan {
namespace {

constexpr char kPairs[] = "calibration.pairs";
constexpr char kOrigin[] = "calibration.origin";

std::string prefix(const std::string& tensor) { return "calibration." + tensor; }

}  // namespace

void add_calibration(const Calibration& calibration, std::map<std::string, TensorView>& tensors,
                     std::map<std::string, std::string>& metadata) {
  metadata[kPairs] = std::to_string(calibration.pairs);
  metadata[kOrigin] = calibration.origin;
  for (const TensorStatistics& statistics : calibration.tensors) {
    const std::string name = prefix(statistics.name);
    const auto channels = static_cast<std::int64_t>(statistics.highest.size());
    tensors[name + ".highest"] = {{channels}, statistics.highest};
    tensors[name + ".mean"] = {{channels}, statistics.mean};
    if (statistics.offset.empty()) continue;
    tensors[name + ".offset"] = {{channels}, statistics.offset};
    tensors[name + ".mixing"] = {{channels, channels}, statistics.mixing};
  }
}

std::shared_ptr<const Calibration> take_calibration(SafetensorsFile& content, int base_channels,
                                                    const std::string& name) {
  if (!content.metadata.contains(kPairs)) return nullptr;
  Calibration calibration;
  calibration.pairs = take_number(content, kPairs, std::numeric_limits<int>::max());
  auto origin = content.metadata.extract(kOrigin);
  if (origin.empty()) throw std::runtime_error("expected metadata calibration.origin, got none");
  calibration.origin = std::move(origin.mapped());
  for (const QuantizedTensor& tensor : quantized_tensors(base_channels)) {
    const std::string field = prefix(tensor.name);
    const std::int64_t channels = tensor.channels;
    TensorStatistics& statistics = calibration.tensors.emplace_back();
    statistics.name = tensor.name;
    statistics.highest = take_tensor(content, field + ".highest", {channels});
    statistics.mean = take_tensor(content, field + ".mean", {channels});
    if (!tensor.leaky) continue;
    statistics.offset = take_tensor(content, field + ".offset", {channels});
    statistics.mixing = take_tensor(content, field + ".mixing", {channels, channels});
  }
  check_calibration(calibration, base_channels, name);
  return std::make_shared<const Calibration>(std::move(calibration));
}

}  // namespace eventgan
