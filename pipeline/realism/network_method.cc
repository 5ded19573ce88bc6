#include "pipeline/realism/network_method.h"

#include <optional>
#include <utility>

#include "manifests/faults.h"
#include "manifests/volume.h"
#include "manifests/weights_name.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights_files/shipped_weights.h"
#include "stages/generator/weights_files/weights_file.h"

namespace eventgan {
namespace {

class NetworkMethod final : public VolumeMethod {
 public:
  NetworkMethod(std::unique_ptr<Generator> generator, std::string weights)
      : generator_(std::move(generator)), weights_(std::move(weights)) {}

  std::string name() const override { return "network"; }
  std::string settings() const override { return "weights " + weights_; }
  int draws() const override { return 1; }

  std::vector<float> volume(const IntervalFrames& frames, int /*draw*/) const override {
    const ImageSize size = frames.previous.size;
    std::vector<float> volume(VolumeShape{generator_->bins(), size}.value_count());
    generator_->generate(network_input(frames), size, volume);
    return volume;
  }

 private:
  std::unique_ptr<Generator> generator_;
  std::string weights_;
};

Weights named_weights(const std::string& name) {
  const std::optional<WeightsName> parsed = parse_weights_name(name);
  if (!parsed || parsed->origin == WeightsOrigin::kUntrained) {
    throw UsageError("--weights: expected a file, shipped or shipped:WIDTH with WIDTH in 1.." +
                     std::to_string(kLargestNamedWidth) + ", got \"" + name + "\"");
  }
  if (parsed->origin == WeightsOrigin::kFile) return read_weights(parsed->path);
  return read_shipped_weights(parsed->width ? *parsed->width : default_shipped_width());
}

}  // namespace

std::unique_ptr<VolumeMethod> make_network_method(std::unique_ptr<Generator> generator,
                                                  const std::string& weights) {
  return std::make_unique<NetworkMethod>(std::move(generator), weights);
}

std::unique_ptr<Generator> open_realism_generator(const std::string& weights) {
  return make_torch_generator(named_weights(weights));
}

}  // namespace eventgan
