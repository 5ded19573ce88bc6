#include "manifests/values/weights.h"

#include <charconv>
#include <utility>

namespace eventgan {
namespace {

constexpr std::string_view kShipped = "shipped";
constexpr std::string_view kShippedSensor = "shipped:sensor";
constexpr std::string_view kShippedWidth = "shipped:";
constexpr std::string_view kUntrainedWidth = "untrained:";

std::optional<int> parse_width(std::string_view text) {
  int width = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, width);
  const bool is_width = error == std::errc() && stop == end && !text.starts_with('0') &&
                        width >= 1 && width <= kLargestNamedWidth;
  return is_width ? std::optional(width) : std::nullopt;
}

}  // namespace

std::optional<WeightsName> parse_weights_name(std::string_view text) {
  if (text == kShipped) return WeightsName{WeightsOrigin::kShipped, {}, std::nullopt};
  if (text == kShippedSensor) return WeightsName{WeightsOrigin::kShipped, {}, kSensorWeights};
  for (const auto& [word, origin] : {std::pair(kShippedWidth, WeightsOrigin::kShipped),
                                     std::pair(kUntrainedWidth, WeightsOrigin::kUntrained)}) {
    if (!text.starts_with(word)) continue;
    const std::optional<int> width = parse_width(text.substr(word.size()));
    return width ? std::optional(WeightsName{origin, {}, width}) : std::nullopt;
  }
  if (text.empty() || text.find('\0') != std::string_view::npos) return std::nullopt;
  return WeightsName{WeightsOrigin::kFile, std::string(text), std::nullopt};
}

}  // namespace eventgan
