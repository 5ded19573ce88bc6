#include "pipeline/library/array_images.h"

#include <fmt/core.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

/// A number of an image, 0..255; nothing if it is not in 0..1 or not a number.
template <class T>
std::optional<std::uint8_t> level_of(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof(value));  // may lie anywhere
  if constexpr (std::is_same_v<T, std::uint8_t>) {
    return value;
  } else {
    if (!(value >= 0 && value <= 1)) return std::nullopt;
    return static_cast<std::uint8_t>(std::lround(value * 255));
  }
}

/// The levels [y, x, channel] of the image at `data`.
template <class T>
std::vector<std::uint8_t> packed(const eventgan_images& images, const std::byte* data,
                                 const char* name) {
  std::vector<std::uint8_t> levels(static_cast<std::size_t>(images.height) *
                                   static_cast<std::size_t>(images.width) *
                                   static_cast<std::size_t>(images.channels));
  auto level = levels.begin();
  for (std::int64_t y = 0; y < images.height; ++y) {
    const std::byte* row = data + y * images.strides[1];
    for (std::int64_t x = 0; x < images.width; ++x, row += images.strides[2]) {
      for (int channel = 0; channel < images.channels; ++channel) {
        const std::byte* at = row + channel * images.strides[3];
        const auto found = level_of<T>(at);
        if (!found) {
          T value;
          std::memcpy(&value, at, sizeof(value));
          throw UsageError("expected floating-point numbers from 0 to 1, got " +
                           fmt::format("{}", value) + " at row " + std::to_string(y) + ", column " +
                           std::to_string(x) + " of " + name);
        }
        *level++ = *found;
      }
    }
  }
  return levels;
}

bool is_packed_uint8(const eventgan_images& images) {
  return images.number == EVENTGAN_UINT8 && (images.channels == 1 || images.strides[3] == 1) &&
         images.strides[2] == images.channels &&
         images.strides[1] == images.channels * images.width;
}

/// "(260, 861, 3)" of each image.
std::string shape_text(const eventgan_images& images) {
  return "(" + std::to_string(images.height) + ", " + std::to_string(images.width) +
         (images.channels == 1 ? ")" : ", " + std::to_string(images.channels) + ")");
}

}  // namespace

Images::Images(const eventgan_images& given, const char* name) : given_(given), name_(name) {
  const auto refuse = [&](const std::string& wanted) {
    throw UsageError("expected " + wanted + ", got shape " + shape_text(given) + " for " + name);
  };
  if (given.channels != 1 && given.channels != 3) refuse("images of 1 or 3 channels");
  constexpr auto kMost = static_cast<std::int64_t>(kMaxImagePixels);
  if (given.height < 1 || given.width < 1 || given.height > kMost || given.width > kMost ||
      given.height * given.width > kMost) {
    refuse("images of 1 to " + std::to_string(kMaxImagePixels) + " pixels");
  }
  if (given.number < EVENTGAN_UINT8 || given.number > EVENTGAN_FLOAT64) {
    throw UsageError("expected numbers of a known kind, got " + std::to_string(given.number) +
                     " for " + name);
  }
  if (given.count < 0 || (given.count > 0 && given.data == nullptr)) {
    throw UsageError("expected images, got " + std::to_string(given.count) + " of them" +
                     (given.data == nullptr ? " nowhere" : "") + " for " + name);
  }
}

PreparedFrame Images::prepared(std::size_t index, const ImageSpec& spec) const {
  const auto* data = static_cast<const std::byte*>(given_.data) +
                     static_cast<std::int64_t>(index) * given_.strides[0];
  std::vector<std::uint8_t> copy;
  const auto* levels = reinterpret_cast<const std::uint8_t*>(data);
  if (!is_packed_uint8(given_)) {
    copy = given_.number == EVENTGAN_UINT8     ? packed<std::uint8_t>(given_, data, name_)
           : given_.number == EVENTGAN_FLOAT32 ? packed<float>(given_, data, name_)
                                               : packed<double>(given_, data, name_);
    levels = copy.data();
  }
  const auto channels =
      given_.channels == 1 ? ImageView::Channels::kGrey : ImageView::Channels::kRgb;
  try {
    return prepare_frame({size(), levels, channels}, spec);
  } catch (const std::runtime_error& error) {
    throw UsageError(std::string(error.what()) + ", in " + name_);
  }
}

ImagePairs::ImagePairs(const eventgan_images& first, const eventgan_images& second)
    : previous(first, "previous"), following(second, "following") {
  if (previous.size() != following.size() || previous.count() != following.count()) {
    throw UsageError("expected as many images of one size, got " + std::to_string(first.count) +
                     " of " + shape_text(first) + " and " + std::to_string(second.count) + " of " +
                     shape_text(second) + " for previous and following");
  }
}

}  // namespace eventgan
