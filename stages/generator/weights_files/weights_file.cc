#include "stages/generator/weights_files/weights_file.h"

#include <charconv>
#include <exception>
#include <stdexcept>

#include "manifests/faults.h"
#include "manifests/training_manifest.h"
#include "stages/generator/weights_files/calibration_fields.h"
#include "stages/generator/weights_files/content_fields.h"
#include "stages/generator/weights_files/safetensors.h"

namespace eventgan {
namespace {

constexpr char kFormat[] = "eventgan-generator";
constexpr char kVersion[] = "1";
constexpr char kTrainingGaps[] = "training_gaps";

GapRange parse_gap_range(const std::string& text) {
  GapRange gaps;
  const char* const end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, gaps.first);
  const bool has_both = first.ec == std::errc() && first.ptr != end && *first.ptr == '-';
  const auto last = std::from_chars(has_both ? first.ptr + 1 : end, end, gaps.last);
  if (!has_both || last.ec != std::errc() || last.ptr != end || gaps.first < 1 ||
      gaps.last < gaps.first) {
    throw std::runtime_error("expected metadata training_gaps FIRST-LAST such as 1-5, got \"" +
                             text + "\"");
  }
  return gaps;
}

/// As the file says; of files trained before they said it, as their training's manifest says.
std::optional<GapRange> take_training_gaps(std::map<std::string, std::string>& metadata) {
  const auto stated = metadata.extract(kTrainingGaps);
  if (!stated.empty()) return parse_gap_range(stated.mapped());
  const auto training = metadata.find("training_manifest");
  if (training == metadata.end()) return std::nullopt;
  try {
    const auto gaps = parse_training_manifest(training->second, {}, "training_manifest").gaps;
    return GapRange{gaps.front(), gaps.back()};
  } catch (const UsageError&) {
    return std::nullopt;  // another program's
  }
}

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
  weights.training_gaps = take_training_gaps(content.metadata);
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
  if (const auto& gaps = weights.training_gaps) {
    metadata[kTrainingGaps] = std::to_string(gaps->first) + "-" + std::to_string(gaps->last);
  }
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
