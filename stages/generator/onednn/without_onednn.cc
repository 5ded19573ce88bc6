#include <algorithm>
#include <stdexcept>

#include "stages/generator/onednn/calibrator.h"
#include "stages/generator/onednn/onednn_generator.h"

namespace eventgan {

OnednnSupport onednn_support(Precision) { return {.instruction_set = "a build without oneDNN"}; }

void require_onednn(const Weights&, Precision) {
  throw std::runtime_error("expected a build with oneDNN, got one without");
}

std::unique_ptr<Generator> make_onednn_generator(const Weights& weights, Precision precision) {
  require_onednn(weights, precision);
  return nullptr;
}

double tiles_work(const TileMask& wanted, int, Precision) {
  return std::ranges::count(wanted.wanted, 1) == 0 ? 0 : 1;
}

double int8_speedup(const Weights&) { return 0; }

struct Calibrator::Network {};
Calibrator::Calibrator(const Weights& weights) : base_channels_(weights.base_channels) {
  require_onednn(weights, Precision::kFloat32);
}
Calibrator::~Calibrator() = default;
void Calibrator::add(const GeneratorInput&) {}
Calibration Calibrator::calibration(std::string) const { return {}; }

}  // namespace eventgan
