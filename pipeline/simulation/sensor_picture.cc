#include "pipeline/simulation/sensor_picture.h"

#include <opencv2/imgproc.hpp>

#include "manifests/faults.h"
#include "manifests/placement.h"
#include "stages/frames/decoding/visible_part.h"

namespace eventgan {

GreyImage sensor_picture(const ColourFrame& frame, std::optional<ImageSize> size) try {
  ImageSpec spec;
  spec.size = size;
  spec.fit = ImageFit::kCrop;
  const Placement placement = place(frame.size, spec);
  const VisiblePart part = visible_part(placement);

  // OpenCV takes no const data; nothing writes to it here.
  const cv::Mat colour(frame.size.height, frame.size.width, CV_8UC3,
                       const_cast<std::uint8_t*>(frame.bgr.data()));
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  cv::Mat scaled;
  const bool shrinks = placement.scaled.width < frame.size.width;
  cv::resize(grey, scaled, cv::Size(placement.scaled.width, placement.scaled.height), 0, 0,
             shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);

  GreyImage picture{part.size, std::vector<std::uint8_t>(part.size.pixel_count())};
  cv::Mat cut(part.size.height, part.size.width, CV_8UC1, picture.pixels.data());
  scaled(cv::Rect(part.scaled_x, part.scaled_y, part.size.width, part.size.height)).copyTo(cut);
  return picture;
} catch (const cv::Exception&) {
  std::throw_with_nested(InputError("expected a frame that can be resized, got another"));
}

}  // namespace eventgan
