#include "stages/generator/weights_files/weights_file.h"

#include <charconv>
#include <exception>
#include <stdexcept>

#include "manifests/faults.h"
#include "stages/generator/weights_files/safetensors.h"

namespace eventgan {
namespace {

constexpr char kFormat[] = "eventgan-generator";
constexpr char kVersion[] = "1";

int take_number(std::map<std::string, std::string>& metadata, const std::string& key, int largest) {
  const std::string text = metadata[key];
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 1 || number > largest) {
    throw std::runtime_error("expected metadata " + key + " in 1.." + std::to_string(largest) +
                             ", got \"" + text + "\"");
  }
  metadata.erase(key);
  return number;
}

NamedTensor take_tensor(StateDict& tensors, const std::string& name,
                        const std::vector<std::int64_t>& shape) {
  auto node = tensors.extract(name);
  if (node.empty()) throw std::runtime_error("expected tensor " + name + ", got none");
  if (node.mapped().shape != shape) {
    throw std::runtime_error("expected another shape of tensor " + name);
  }
  return std::move(node.mapped());
}

Weights from_content(SafetensorsFile content) {
  if (content.metadata["format"] != kFormat || content.metadata["format_version"] != kVersion) {
    throw std::runtime_error("expected metadata format " + std::string(kFormat) + " version " +
                             kVersion + ", got \"" + content.metadata["format"] + "\" version \"" +
                             content.metadata["format_version"] +
                             "\" (eventgan import-weights converts a PyTorch checkpoint)");
  }
  content.metadata.erase("format");
  content.metadata.erase("format_version");
  Weights weights;
  weights.base_channels = take_number(content.metadata, "base_channels", kMostBaseChannels);
  weights.bins = take_number(content.metadata, "bins", kMostWeightBins);
  weights.convolutions = network_layout(weights.base_channels, weights.bins);
  for (Convolution& convolution : weights.convolutions) {
    const std::int64_t out = convolution.out_channels;
    const std::int64_t side = convolution.kernel;
    convolution.weight = take_tensor(content.tensors, convolution.name + ".weight",
                                     {out, convolution.in_channels, side, side})
                             .values;
    convolution.bias = take_tensor(content.tensors, convolution.name + ".bias", {out}).values;
  }
  if (!content.tensors.empty()) {
    throw std::runtime_error("expected no other tensors, got " + content.tensors.begin()->first);
  }
  weights.metadata = std::move(content.metadata);
  return weights;
}

Weights checked_weights(SafetensorsFile content, const std::string& name) {
  Weights weights = from_content(std::move(content));
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
