#include "stages/frames/decoding/placed_picture.h"

#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "stages/frames/decoding/visible_part.h"

namespace eventgan {

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
