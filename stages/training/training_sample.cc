#include "stages/training/training_sample.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <string>

namespace eventgan {
namespace {

/// Counters of the numbers drawn for one sample.
enum AugmentationDraw : std::uint64_t { kTop, kLeft, kFlipX, kFlipY, kGain, kGamma, kReverse };

constexpr std::size_t kFrames = 2;

void require(bool holds, const std::string& message) {
  if (!holds) throw std::invalid_argument(message);
}

void require_within(int top, int left, ImageSize crop, ImageSize image, const std::string& origin) {
  // Subtractions of values that are not negative cannot overflow, sums could.
  require(crop.height > 0 && crop.width > 0 && top >= 0 && left >= 0 &&
              crop.height <= image.height && crop.width <= image.width &&
              top <= image.height - crop.height && left <= image.width - crop.width,
          "expected a crop within " + to_string(image) + " pixels, got " + to_string(crop) +
              " at row " + std::to_string(top) + ", column " + std::to_string(left) +
              (origin.empty() ? "" : ", in " + origin) + " (augmentation)");
}

float uniform(const std::array<double, 2>& range, const CounterRandom& random,
              AugmentationDraw draw) {
  return static_cast<float>(range[0] + (range[1] - range[0]) * random.uniform(draw));
}

/// Cuts and flips `planes` images of `from` pixels that lie one after the other.
std::vector<float> cut(const std::vector<float>& values, std::size_t planes, ImageSize from,
                       const Augmentation& augmentation) {
  const auto [height, width] = augmentation.crop;
  std::vector<float> result;
  result.reserve(planes * augmentation.crop.pixel_count());
  for (std::size_t plane = 0; plane < planes; ++plane) {
    for (int y = 0; y < height; ++y) {
      const int row = augmentation.top + (augmentation.flip_y ? height - 1 - y : y);
      const auto first =
          values.begin() + static_cast<std::ptrdiff_t>(plane * from.pixel_count() +
                                                       static_cast<std::size_t>(row) * from.width +
                                                       augmentation.left);
      if (augmentation.flip_x) {
        result.insert(result.end(), std::make_reverse_iterator(first + width),
                      std::make_reverse_iterator(first));
      } else {
        result.insert(result.end(), first, first + width);
      }
    }
  }
  return result;
}

/// Images of `pixels` pixels that lie one after the other: the last comes first.
void reverse_planes(std::vector<float>& values, std::size_t pixels) {
  auto low = values.begin();
  for (auto high = values.end(); high - low >= 2 * static_cast<std::ptrdiff_t>(pixels);) {
    high -= static_cast<std::ptrdiff_t>(pixels);
    low = std::swap_ranges(high, high + static_cast<std::ptrdiff_t>(pixels), low);
  }
}

/// Not std::min and std::max, which would take a NaN for the bound.
float with_gain_and_gamma(float x, float gain, float gamma) {
  const float u = (x + 1) / 2;
  const float changed = gain * std::pow(u < 0 ? 0.0f : u, gamma);
  return 2 * (changed > 1 ? 1.0f : changed) - 1;
}

}  // namespace

Augmentation draw_augmentation(ImageSize image, ImageSize crop, const AugmentationSpec& spec,
                               CounterRandom random) {
  require_within(0, 0, crop, image, "");
  const auto place = [&](AugmentationDraw draw, int from, int cut) {
    return static_cast<int>(random.below(draw, static_cast<std::uint64_t>(from - cut) + 1));
  };
  Augmentation result;
  result.crop = crop;
  result.top = place(kTop, image.height, crop.height);
  result.left = place(kLeft, image.width, crop.width);
  result.flip_x = spec.flip && random.below(kFlipX, 2) == 1;
  result.flip_y = spec.flip && random.below(kFlipY, 2) == 1;
  result.reverse = spec.reverse && random.below(kReverse, 2) == 1;
  result.gain = uniform(spec.gain, random, kGain);
  result.gamma = uniform(spec.gamma, random, kGamma);
  return result;
}

TrainingSample augment(const TrainingSample& sample, const Augmentation& augmentation) {
  const ImageSize size = sample.shape.size;
  require_within(augmentation.top, augmentation.left, augmentation.crop, size, sample.origin);
  require(sample.frames.size() == kFrames * size.pixel_count() &&
              sample.volume.size() == sample.shape.value_count(),
          "expected 2 frames and a volume of " + to_string(size) + " pixels, got " +
              std::to_string(sample.frames.size()) + " and " +
              std::to_string(sample.volume.size()) + " values, in " + sample.origin +
              " (augmentation)");

  TrainingSample result;
  result.shape = {sample.shape.bins, augmentation.crop};
  result.frames = cut(sample.frames, kFrames, size, augmentation);
  result.volume =
      cut(sample.volume, static_cast<std::size_t>(sample.shape.channels()), size, augmentation);
  if (augmentation.reverse) {  // channels are polarity by polarity: turned round, both are reversed
    reverse_planes(result.frames, augmentation.crop.pixel_count());
    reverse_planes(result.volume, augmentation.crop.pixel_count());
  }
  result.network_frames = result.frames;
  if (augmentation.gain != 1 || augmentation.gamma != 1) {
    for (float& x : result.network_frames)
      x = with_gain_and_gamma(x, augmentation.gain, augmentation.gamma);
  }
  if (const auto& told = sample.threshold) {
    result.threshold = ContrastThreshold{told->mean * augmentation.gamma,
                                         augmentation.reverse ? 1 / told->ratio : told->ratio};
  }
  result.origin =
      sample.origin + ", crop " + to_string(augmentation.crop) + " at row " +
      std::to_string(augmentation.top) + ", column " + std::to_string(augmentation.left) +
      (augmentation.flip_x ? ", flipped in x" : "") +
      (augmentation.flip_y ? ", flipped in y" : "") + (augmentation.reverse ? ", reversed" : "");
  return result;
}

}  // namespace eventgan
