#include "stages/frames/decoding/prepared_frame.h"

#include <algorithm>
#include <array>
#include <exception>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace eventgan {

VisiblePart visible_part(const Placement& placement) {
  VisiblePart part;
  part.scaled_x = std::max(0, -placement.offset_x);
  part.scaled_y = std::max(0, -placement.offset_y);
  part.volume_x = std::max(0, placement.offset_x);
  part.volume_y = std::max(0, placement.offset_y);
  part.size.height =
      std::min(placement.scaled.height - part.scaled_y, placement.volume.height - part.volume_y);
  part.size.width =
      std::min(placement.scaled.width - part.scaled_x, placement.volume.width - part.volume_x);
  return part;
}

namespace {

using Channels = ImageView::Channels;

cv::Mat as_grey(const cv::Mat& image, Channels channels) {
  if (channels == Channels::kGrey) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, channels == Channels::kBgr ? cv::COLOR_BGR2GRAY : cv::COLOR_RGB2GRAY);
  return grey;
}

cv::Mat matrix_of(const ImageView& image) {
  return {image.size.height, image.size.width,
          image.channels == Channels::kGrey ? CV_8UC1 : CV_8UC3,
          const_cast<std::uint8_t*>(image.pixels)};
}

/// What is resized: of the image what `placement` leaves of it.
cv::Mat without_borders(const cv::Mat& image, const Placement& placement) {
  const ImageSize cut = placement.cut();
  return image(cv::Rect(placement.border_x, placement.border_y, cut.width, cut.height));
}

/// An image of these channels as it is to be resized.
struct Resizable {
  cv::Mat image;
  Channels channels;
};

Resizable grey_if_first(const ImageView& frame, const ImageSpec& spec) {
  const cv::Mat image = matrix_of(frame);
  if (spec.grey == GreyOrder::kAfterResize) return {image, frame.channels};
  return {as_grey(image, frame.channels), Channels::kGrey};
}

/// Resized, grey and blurred, uncut.
cv::Mat scaled_grey(const Resizable& whole, const Placement& placement, const ImageSpec& spec) {
  const cv::Size scaled(placement.scaled.width, placement.scaled.height);
  cv::Mat resized = without_borders(whole.image, placement);
  if (resized.size() != scaled) {  // else OpenCV would make a copy
    cv::Mat other;
    cv::resize(resized, other, scaled, 0, 0, cv::INTER_LINEAR);
    resized = other;
  }
  resized = as_grey(resized, whole.channels);
  if (spec.blur == 0) return resized;
  cv::Mat blurred;
  cv::GaussianBlur(resized, blurred, cv::Size(spec.blur, spec.blur), 0);
  return blurred;
}

/// See move_still.
cv::Mat moved(const cv::Mat& image, const FramePair& pair) {
  const ImageSize size{image.rows, image.cols};
  if (std::max(size.height, size.width) > kMostStillSide) {
    throw std::invalid_argument("expected a still of at most " + std::to_string(kMostStillSide) +
                                " pixels a side, got " + to_string(size));
  }
  std::array<double, 6> map = moved_to_labelled(size, pair);
  cv::Mat result;
  cv::warpAffine(image, result, cv::Mat(2, 3, CV_64F, map.data()), image.size(),
                 cv::INTER_CUBIC | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  return result;
}

std::vector<std::uint8_t> cut(const cv::Mat& grey, const VisiblePart& part) {
  std::vector<std::uint8_t> pixels;
  pixels.reserve(part.size.pixel_count());
  for (int y = 0; y < part.size.height; ++y) {
    const std::uint8_t* row = grey.ptr<std::uint8_t>(part.scaled_y + y) + part.scaled_x;
    pixels.insert(pixels.end(), row, row + part.size.width);
  }
  return pixels;
}

constexpr auto kInputOfGrey = [] {
  std::array<float, 256> table{};
  for (int level = 0; level < 256; ++level) {
    table[level] = (static_cast<float>(level) / 255.0f - 0.5f) * 2.0f;
  }
  return table;
}();

/// What `prepare` returns; what OpenCV and `place` throw becomes a std::runtime_error.
template <class Prepare>
auto unless_refused(Prepare prepare) {
  try {
    return prepare();
  } catch (const cv::Exception& exception) {
    std::throw_with_nested(
        std::runtime_error("expected frames that can be resized, got " + exception.err));
  } catch (const std::invalid_argument& exception) {
    std::throw_with_nested(std::runtime_error(exception.what()));
  }
}

PreparedFrame prepare(const Resizable& image, const Placement& placement, const ImageSpec& spec) {
  return {cut(scaled_grey(image, placement, spec), visible_part(placement)), placement};
}

}  // namespace

PreparedFrame prepare_frame(const ImageView& frame, const ImageSpec& spec) {
  return unless_refused([&] {
    const Placement placement = place(frame.size, spec);
    return prepare(grey_if_first(frame, spec), placement, spec);
  });
}

std::array<PreparedFrame, 2> prepare_still(const ColourView& image, const FramePair& pair,
                                           const ImageSpec& spec) {
  return unless_refused([&] {
    const Placement placement = place(image.size, spec, pair);
    const Resizable still = grey_if_first(image, spec);
    std::array<PreparedFrame, 2> frames = {
        prepare({moved(still.image, pair), still.channels}, placement, spec),
        prepare(still, placement, spec)};
    if (pair.label_position == 0) std::swap(frames[0], frames[1]);
    return frames;
  });
}

ColourFrame move_still(const ColourFrame& image, const FramePair& pair) {
  return unless_refused([&] {
    const cv::Mat result = moved(matrix_of({image.size, image.bgr.data()}), pair);
    return ColourFrame{image.size, {result.datastart, result.dataend}};
  });
}

void to_input(std::span<const std::uint8_t> grey, std::span<float> input) {
  std::ranges::transform(grey, input.begin(),
                         [](std::uint8_t level) { return kInputOfGrey[level]; });
}

PreparedPair prepare_pair(const PreparedFrame& previous, const PreparedFrame& next) {
  PreparedPair prepared;
  prepared.placement = previous.placement;
  const VisiblePart part = visible_part(prepared.placement);
  prepared.content = part.size;
  prepared.content_x = part.volume_x;
  prepared.content_y = part.volume_y;
  // By way of a block in the first-level cache: a vector that is made longer is filled with zeros.
  std::array<float, 4096> block;
  prepared.input.reserve(2 * part.size.pixel_count());
  for (std::span<const std::uint8_t> grey : {std::span(previous.grey), std::span(next.grey)}) {
    while (!grey.empty()) {
      const std::size_t count = std::min(grey.size(), block.size());
      to_input(grey.first(count), block);
      prepared.input.insert(prepared.input.end(), block.begin(), block.begin() + count);
      grey = grey.subspan(count);
    }
  }
  return prepared;
}

std::vector<std::uint8_t> place_colour(const ColourFrame& frame, const Placement& placement) {
  if (frame.size != placement.source) {
    throw std::invalid_argument("expected a frame of the placement's source size, got another");
  }
  const ImageSize volume = placement.volume;
  std::vector<std::uint8_t> placed(3 * volume.pixel_count(), 0);
  const cv::Mat source = matrix_of({frame.size, frame.bgr.data()});
  cv::Mat scaled;
  cv::resize(without_borders(source, placement), scaled,
             cv::Size(placement.scaled.width, placement.scaled.height), 0, 0, cv::INTER_LINEAR);

  const VisiblePart part = visible_part(placement);
  const cv::Size size(part.size.width, part.size.height);
  cv::Mat canvas(volume.height, volume.width, CV_8UC3, placed.data());
  scaled(cv::Rect(cv::Point(part.scaled_x, part.scaled_y), size))
      .copyTo(canvas(cv::Rect(cv::Point(part.volume_x, part.volume_y), size)));
  return placed;
}

}  // namespace eventgan
