#include "tests/testing/image_file.h"

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace eventgan::testing {

void write_flat_image(const std::filesystem::path& path, ImageSize size, int value) {
  std::filesystem::create_directories(path.parent_path());
  const cv::Mat image(size.height, size.width, CV_8UC1, cv::Scalar(value));
  if (!cv::imwrite(path.string(), image)) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace eventgan::testing
