#include "stages/frames/decoding/prepared_frame.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "stages/frames/decoding/detail/frame_steps.h"
#include "stages/frames/decoding/detail/unless_refused.h"

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

/// What is resized: of the image what `placement` leaves of it.
cv::Mat without_borders(const cv::Mat& image, const Placement& placement) {
  const ImageSize cut = placement.cut();
  return image(cv::Rect(placement.border_x, placement.border_y, cut.width, cut.height));
}

constexpr auto kInputOfGrey = [] {
  std::array<float, 256> table{};
  for (int level = 0; level < 256; ++level) {
    table[level] = (static_cast<float>(level) / 255.0f - 0.5f) * 2.0f;
  }
  return table;
}();

}  // namespace

cv::Mat matrix_of(const ImageView& image) {
  return {image.size.height, image.size.width,
          image.channels == Channels::kGrey ? CV_8UC1 : CV_8UC3,
          const_cast<std::uint8_t*>(image.pixels)};
}

Resizable grey_if_first(const ImageView& frame, const ImageSpec& spec) {
  const cv::Mat image = matrix_of(frame);
  if (spec.grey == GreyOrder::kAfterResize) return {image, frame.channels};
  return {as_grey(image, frame.channels), Channels::kGrey};
}

cv::Mat scaled_grey(const Resizable& whole, const Placement& placement) {
  const cv::Size scaled(placement.scaled.width, placement.scaled.height);
  cv::Mat resized = without_borders(whole.image, placement);
  if (resized.size() != scaled) {  // else OpenCV would make a copy
    cv::Mat other;
    cv::resize(resized, other, scaled, 0, 0, cv::INTER_LINEAR);
    resized = other;
  }
  return as_grey(resized, whole.channels);
}

std::vector<std::uint8_t> finished(cv::Mat scaled, const Placement& placement,
                                   const ImageSpec& spec) {
  if (spec.blur != 0) {
    cv::Mat blurred;
    cv::GaussianBlur(scaled, blurred, cv::Size(spec.blur, spec.blur), 0, 0,
                     cv::BORDER_DEFAULT | cv::BORDER_ISOLATED);  // nothing from beyond a cut
    scaled = blurred;
  }
  const VisiblePart part = visible_part(placement);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(part.size.pixel_count());
  for (int y = 0; y < part.size.height; ++y) {
    const std::uint8_t* row = scaled.ptr<std::uint8_t>(part.scaled_y + y) + part.scaled_x;
    pixels.insert(pixels.end(), row, row + part.size.width);
  }
  return pixels;
}

PreparedFrame prepare_frame(const ImageView& frame, const ImageSpec& spec) {
  return unless_refused([&] {
    const Placement placement = place(frame.size, spec);
    return PreparedFrame{
        finished(scaled_grey(grey_if_first(frame, spec), placement), placement, spec), placement};
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
