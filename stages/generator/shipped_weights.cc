#include "stages/generator/shipped_weights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "manifests/values/faults.h"
#include "manifests/values/weights.h"
#include "stages/generator/weights_file.h"

namespace eventgan {

/// One embedded file, as the generated assembly lays it out (shipped_weights.cmake).
struct ShippedFile {
  std::int64_t width;
  const std::byte* begin;
  const std::byte* end;
};

extern "C" {
extern const ShippedFile eventgan_shipped_begin[];
extern const ShippedFile eventgan_shipped_end[];
}

namespace {

constexpr int kLargestDefaultWidth = 16;

std::span<const ShippedFile> shipped_files() {
  return {eventgan_shipped_begin, eventgan_shipped_end};
}

std::string width_list() {
  const std::vector<int> widths = shipped_widths();
  return widths.empty() ? "none" : fmt::format("{}", fmt::join(widths, ", "));
}

}  // namespace

std::vector<int> shipped_widths() {
  std::vector<int> widths;
  for (const ShippedFile& file : shipped_files()) {
    if (file.width != kSensorWeights) widths.push_back(static_cast<int>(file.width));
  }
  return widths;
}

int default_shipped_width() {
  const std::vector<int> widths = shipped_widths();
  const auto beyond = std::ranges::upper_bound(widths, kLargestDefaultWidth);
  if (beyond == widths.begin()) {
    throw InputError("expected shipped weights of a base width of at most " +
                     std::to_string(kLargestDefaultWidth) + ", got " + width_list() +
                     ", in this program");
  }
  return *(beyond - 1);
}

std::string shipped_weights_name(const std::string& name) {
  return name == "shipped" ? name + ":" + std::to_string(default_shipped_width()) : name;
}

std::span<const std::byte> shipped_weights_bytes(int width) {
  for (const ShippedFile& file : shipped_files()) {
    if (file.width == width) return {file.begin, file.end};
  }
  throw InputError("expected a base width of the shipped weights (" + width_list() + "), got " +
                   std::to_string(width) + ", in this program");
}

Weights read_shipped_weights(int width) {
  const std::span<const std::byte> bytes = shipped_weights_bytes(width);
  return parse_weights({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                       width == kSensorWeights
                           ? "the shipped weights of a sensor"
                           : "the shipped weights of base width " + std::to_string(width));
}

}  // namespace eventgan
