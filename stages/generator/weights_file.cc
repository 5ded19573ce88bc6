#include "stages/generator/weights_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/documents/training_manifest.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "stages/generator/calibration.h"
#include "stages/generator/safetensors.h"

namespace eventgan {
namespace {

// What a reader takes out of a file's content, so that what is left over is known. Both throw
// std::runtime_error "expected X, got Y".

/// A whole number in 1..largest from the metadata.
int take_number(SafetensorsFile& content, const std::string& key, int largest) {
  const std::string text = content.metadata[key];
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 1 || number > largest) {
    throw std::runtime_error("expected metadata " + key + " in 1.." + std::to_string(largest) +
                             ", got \"" + text + "\"");
  }
  content.metadata.erase(key);
  return number;
}

/// A tensor of exactly this shape.
std::vector<float> take_tensor(SafetensorsFile& content, const std::string& name,
                               const std::vector<std::int64_t>& shape) {
  auto node = content.tensors.extract(name);
  if (node.empty()) throw std::runtime_error("expected tensor " + name + ", got none");
  if (node.mapped().shape != shape) {
    throw std::runtime_error("expected another shape of tensor " + name);
  }
  return std::move(node.mapped().values);
}

// How a weights file holds a calibration: metadata calibration.pairs and calibration.origin, and
// for each tensor calibration.TENSOR.highest and .mean [channel], behind a LeakyReLU also .offset
// [channel] and .mixing [channel, channel].

constexpr char kPairs[] = "calibration.pairs";
constexpr char kOrigin[] = "calibration.origin";

std::string prefix(const std::string& tensor) { return "calibration." + tensor; }

/// Adds views of the calibration, which must outlive them.
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

/// Takes the calibration out of the content; null if there is none. Throws std::runtime_error
/// "expected X, got Y" if it is not whole, or as check_calibration.
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

constexpr char kFormat[] = "eventgan-generator";
constexpr char kVersion[] = "1";
constexpr char kTrainingGaps[] = "training_gaps";
constexpr char kThresholds[] = "thresholds";

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

/// Of a network that knows its sensor.
std::optional<ThresholdRange> take_thresholds(std::map<std::string, std::string>& metadata) {
  const auto stated = metadata.extract(kThresholds);
  if (stated.empty()) return std::nullopt;
  const std::string& text = stated.mapped();
  ThresholdRange range;
  const char* const end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, range.lowest);
  const bool has_both = first.ec == std::errc() && first.ptr != end && *first.ptr == '-';
  const auto last = std::from_chars(has_both ? first.ptr + 1 : end, end, range.highest);
  if (!has_both || last.ec != std::errc() || last.ptr != end ||
      !(range.lowest > 0 && range.lowest <= range.highest && range.highest < 1e6)) {
    throw std::runtime_error("expected metadata thresholds LOWEST-HIGHEST such as 0.1-0.8, got \"" +
                             text + "\"");
  }
  return range;
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
  weights.thresholds = take_thresholds(content.metadata);
  weights.convolutions = network_layout(weights.base_channels, weights.bins, weights.inputs());
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
  if (const auto& thresholds = weights.thresholds) {
    metadata[kThresholds] = fmt::format("{}-{}", thresholds->lowest, thresholds->highest);
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

namespace {

/// What PyTorch writes: a zip archive, or before version 1.6 a pickle. In safetensors these bytes
/// are the header's length, of which the upper half is 0.
bool is_pytorch_checkpoint(const std::filesystem::path& file) {
  constexpr std::size_t kLengthBytes = 8;
  const InputFile bytes(file);
  if (bytes.size_bytes() < kLengthBytes) return false;
  const std::string text = bytes.read(0, kLengthBytes);
  const bool has_length = text.ends_with(std::string_view("\0\0\0\0", 4));
  return !has_length && (text.starts_with("PK\3\4") || text.starts_with('\x80'));
}

}  // namespace

Weights read_weights(const std::filesystem::path& file) try {
  if (is_pytorch_checkpoint(file)) {
    std::filesystem::path converted = file;
    converted.replace_extension(".safetensors");
    if (converted == file) converted.replace_extension("imported.safetensors");
    throw std::runtime_error(
        "expected weights in safetensors, got a PyTorch checkpoint: run "
        "`eventgan import-weights \"" +
        file.string() + "\" \"" + converted.string() + "\"`");
  }
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
