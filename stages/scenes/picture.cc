#include "stages/scenes/picture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace eventgan {
namespace {

std::uint8_t rounded(float value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0f, 255.0f)));
}

void write(const Picture& picture, const std::filesystem::path& path,
           const std::vector<int>& parameters) {
  const cv::Mat view(picture.size.height, picture.size.width, CV_8UC3,
                     const_cast<std::uint8_t*>(picture.bgr.data()));
  bool written = false;
  try {
    written = cv::imwrite(path.string(), view, parameters);
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot write " + path.string() + ": " + exception.err);
  }
  if (!written) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace

Picture black_picture(ImageSize size) {
  return {size, std::vector<std::uint8_t>(3 * size.pixel_count(), 0)};
}

void set_pixel(Picture& picture, int x, int y, const Colour& colour) {
  std::uint8_t* pixel =
      picture.bgr.data() + 3 * (static_cast<std::size_t>(y) * picture.size.width + x);
  pixel[0] = rounded(colour.blue);
  pixel[1] = rounded(colour.green);
  pixel[2] = rounded(colour.red);
}

void write_png(const Picture& picture, const std::filesystem::path& path) {
  write(picture, path, {cv::IMWRITE_PNG_COMPRESSION, 6});
}

void write_jpeg(const Picture& picture, const std::filesystem::path& path) {
  write(picture, path, {cv::IMWRITE_JPEG_QUALITY, 90});
}

}  // namespace eventgan
