#include "stages/events/images/image_output.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "manifests/files/atomic_file.h"

namespace eventgan {

void write_png(const ColourFrame& image, const std::filesystem::path& path) {
  write_file_atomically(path, encode_png({image.size, image.bgr.data()}, /*is_drawn=*/true));
}

std::string jpeg_of(const ColourFrame& image, std::size_t most_bytes) try {
  cv::Mat pixels(image.size.height, image.size.width, CV_8UC3,
                 const_cast<std::uint8_t*>(image.bgr.data()));
  for (;; cv::resize(pixels, pixels, {}, 0.5, 0.5, cv::INTER_AREA)) {
    for (const int quality : {85, 70, 50, 30}) {
      std::string jpeg = encode_jpeg({{pixels.rows, pixels.cols}, pixels.data}, quality);
      if (jpeg.size() <= most_bytes || pixels.rows < 2 || pixels.cols < 2) return jpeg;
    }
  }
} catch (const cv::Exception& exception) {
  throw std::runtime_error("cannot encode an image: " + exception.err);
}

}  // namespace eventgan
