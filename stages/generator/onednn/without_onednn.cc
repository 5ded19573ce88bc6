#include <stdexcept>

#include "stages/generator/onednn/onednn_generator.h"

namespace eventgan {

OnednnSupport onednn_support(Precision) { return {.instruction_set = "a build without oneDNN"}; }

std::unique_ptr<Generator> make_onednn_generator(const Weights&, Precision) {
  throw std::runtime_error("expected a build with oneDNN, got one without");
}

}  // namespace eventgan
