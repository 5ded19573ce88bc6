#include "stages/frames/decoding/prepared_frame.h"

#include <algorithm>
#include <array>
#include <exception>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

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

cv::Mat as_grey(const cv::Mat& colour) {
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

/// Grey, resized and blurred, uncut.
cv::Mat scaled_grey(const ColourView& frame, ImageSize scaled, const ImageSpec& spec) {
  cv::Mat image(frame.size.height, frame.size.width, CV_8UC3, const_cast<std::uint8_t*>(frame.bgr));
  if (spec.grey == GreyOrder::kBeforeResize) image = as_grey(image);
  cv::Mat resized;
  cv::resize(image, resized, cv::Size(scaled.width, scaled.height), 0, 0, cv::INTER_LINEAR);
  if (spec.grey == GreyOrder::kAfterResize) resized = as_grey(resized);
  if (spec.blur == 0) return resized;
  cv::Mat blurred;
  cv::GaussianBlur(resized, blurred, cv::Size(spec.blur, spec.blur), 0);
  return blurred;
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

[[noreturn]] void refuse(const std::string& why) {
  std::throw_with_nested(std::runtime_error("expected frames that can be resized, got " + why));
}

}  // namespace

PreparedFrame prepare_frame(const ColourView& frame, const ImageSpec& spec) {
  try {
    const Placement placement = place(frame.size, spec);
    return {cut(scaled_grey(frame, placement.scaled, spec), visible_part(placement)), placement};
  } catch (const cv::Exception& exception) {
    refuse(exception.err);
  } catch (const std::invalid_argument& exception) {
    refuse(exception.what());
  }
}

void to_input(std::span<const std::uint8_t> grey, std::span<float> input) {
  std::ranges::transform(grey, input.begin(),
                         [](std::uint8_t level) { return kInputOfGrey[level]; });
}

std::vector<std::uint8_t> place_colour(const ColourFrame& frame, const Placement& placement) {
  if (frame.size != placement.source) {
    throw std::invalid_argument("expected a frame of the placement's source size, got another");
  }
  const ImageSize volume = placement.volume;
  std::vector<std::uint8_t> placed(3 * volume.pixel_count(), 0);
  const cv::Mat source(frame.size.height, frame.size.width, CV_8UC3,
                       const_cast<std::uint8_t*>(frame.bgr.data()));
  cv::Mat scaled;
  cv::resize(source, scaled, cv::Size(placement.scaled.width, placement.scaled.height), 0, 0,
             cv::INTER_LINEAR);

  const VisiblePart part = visible_part(placement);
  const cv::Size size(part.size.width, part.size.height);
  cv::Mat canvas(volume.height, volume.width, CV_8UC3, placed.data());
  scaled(cv::Rect(cv::Point(part.scaled_x, part.scaled_y), size))
      .copyTo(canvas(cv::Rect(cv::Point(part.volume_x, part.volume_y), size)));
  return placed;
}

}  // namespace eventgan
