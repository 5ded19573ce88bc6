#include "stages/generator/weights_files/weights_file.h"

#include <exception>
#include <stdexcept>

#include "manifests/faults.h"
#include "stages/generator/weights_files/calibration_fields.h"
#include "stages/generator/weights_files/content_fields.h"
#include "stages/generator/weights_files/safetensors.h"

namespace eventgan {
namespace {

constexpr char kFormat[] = "eventgan-generator";
constexpr char kVersion[] = "1";

Weights from_content(SafetensorsFile content, const std::string& name) {
  if (content.metadata["format"] != kFormat || content.metadata["format_version"] != kVersion) {
    throw std::runtime_error("expected metadata format " + std::string(kFormat) + " version " +
                             kVersion + ", got \"" + content.metadata["format"] + "\" version \"" +
                             content.metadata["format_version"] +
                             "\" (eventgan import-weights converts a PyTorch checkpoint)");
  }
  content.metadata.erase("format");
  content.metadata.erase("format_version");
  Weights weights;
  weights.base_channels = take_number(content, "base_channels", kMostBaseChannels);
  weights.bins = take_number(content, "bins", kMostWeightBins);
  weights.convolutions = network_layout(weights.base_channels, weights.bins);
  for (Convolution& convolution : weights.convolutions) {
    const std::int64_t out = convolution.out_channels;
    const std::int64_t side = convolution.kernel;
    convolution.weight = take_tensor(content, convolution.name + ".weight",
                                     {out, convolution.in_channels, side, side});
    convolution.bias = take_tensor(content, convolution.name + ".bias", {out});
  }
  weights.calibration = take_calibration(content, weights.base_channels, name);
  if (!content.tensors.empty()) {
    throw std::runtime_error("expected no other tensors, got " + content.tensors.begin()->first);
  }
  weights.metadata = std::move(content.metadata);
  return weights;
}

Weights checked_weights(SafetensorsFile content, const std::string& name) {
  Weights weights = from_content(std::move(content), name);
  check_weights(weights, name);
  return weights;
}

}  // namespace

std::string serialize_weights(const Weights& weights) {
  std::map<std::string, std::string> metadata = weights.metadata;
  metadata["format"] = kFormat;
  metadata["format_version"] = kVersion;
  metadata["base_channels"] = std::to_string(weights.base_channels);
  metadata["bins"] = std::to_string(weights.bins);
  std::map<std::string, TensorView> tensors;
  for (const Convolution& convolution : weights.convolutions) {
    const std::int64_t out = convolution.out_channels;
    const std::int64_t side = convolution.kernel;
    tensors[convolution.name + ".weight"] = {{out, convolution.in_channels, side, side},
                                             convolution.weight};
    tensors[convolution.name + ".bias"] = {{out}, convolution.bias};
  }
  if (weights.calibration) add_calibration(*weights.calibration, tensors, metadata);
  return serialize_safetensors(tensors, metadata);
}

Weights read_weights(const std::filesystem::path& file) try {
  return checked_weights(read_safetensors(file), file.string());
} catch (const std::runtime_error&) {
  std::throw_with_nested(InputError("cannot use the weights in " + file.string()));
}

Weights parse_weights(std::string_view bytes, const std::string& name) try {
  return checked_weights(parse_safetensors(bytes, name), name);
} catch (const std::runtime_error&) {
  std::throw_with_nested(InputError("cannot use the weights in " + name));
}

}  // namespace eventgan
