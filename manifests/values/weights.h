#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

inline constexpr int kLargestNamedWidth = 64;

/// Where a generator's weights come from.
enum class WeightsOrigin {
  kFile,      ///< PATH of a .safetensors file
  kShipped,   ///< "shipped", "shipped:WIDTH" or "shipped:sensor": a part of the program
  kUntrained  ///< "untrained:WIDTH": random numbers
};

/// In place of a width: the shipped weights that know their sensor, "shipped:sensor".
inline constexpr int kSensorWeights = 0;

/// What manifests and options name weights by.
struct WeightsName {
  WeightsOrigin origin = WeightsOrigin::kFile;
  std::string path;          ///< kFile
  std::optional<int> width;  ///< base width, 1..64, or kSensorWeights; kShipped without one means
                             ///< the default
  bool operator==(const WeightsName&) const = default;
};

/// None for what names nothing: an empty text, one with NUL, another WIDTH than 1..64 in decimal
/// digits without a zero in front.
std::optional<WeightsName> parse_weights_name(std::string_view text);

/// A tensor as a checkpoint or weights file holds it, converted to float32.
struct NamedTensor {
  std::vector<std::int64_t> shape;
  std::vector<float> values;  ///< C order, as many as the shape says
};

/// Tensors by name, as PyTorch's state_dict().
using StateDict = std::map<std::string, NamedTensor>;

}  // namespace eventgan
