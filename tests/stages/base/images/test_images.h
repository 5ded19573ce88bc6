#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

#include "stages/base/images/image_file.h"

namespace eventgan::testing {

/// A colour image in which every pixel differs from its neighbours, smooth enough for JPEG.
inline cv::Mat gradient_image(ImageSize size) {
  cv::Mat image(size.height, size.width, CV_8UC3);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at<cv::Vec3b>(y, x) =
          cv::Vec3b(static_cast<std::uint8_t>(x * 7), static_cast<std::uint8_t>(y * 5),
                    static_cast<std::uint8_t>(x * 3 + y * 11));
    }
  }
  return image;
}

/// What OpenCV makes of a whole file, as stored.
inline cv::Mat opencv_read(const std::filesystem::path& file) {
  return cv::imread(file.string(), cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
}

/// The same JPEG with an APP1 of EXIF: a TIFF header (little endian, directory at 8) of one entry,
/// tag 0x0112 (orientation), type 3 (short), count 1.
inline std::string with_orientation(const std::string& jpeg, int orientation) {
  using namespace std::string_literals;
  const std::string exif = "Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"s +
                           static_cast<char>(orientation) + "\0\0\0\0\0\0\0"s;
  return jpeg.substr(0, 2) + "\xff\xe1\0"s + static_cast<char>(exif.size() + 2) + exif +
         jpeg.substr(2);
}

/// Calls `read(std::FILE*)` on an open file.
template <class Read>
auto with_open(const std::filesystem::path& path, Read read) {
  struct Closer {
    std::FILE* file;
    ~Closer() {
      if (file != nullptr) std::fclose(file);
    }
  } open{std::fopen(path.c_str(), "rb")};
  return read(open.file);
}

/// The message of the std::runtime_error that `read(std::FILE*)` throws on a file; empty if none.
template <class Read>
std::string why_refused(const std::filesystem::path& path, Read read) try {
  with_open(path, read);
  return "";
} catch (const std::runtime_error& error) {
  return error.what();
}

/// True if both hold the same pixels.
inline bool same_pixels(const ColourFrame& frame, const cv::Mat& image) {
  const cv::Mat view(frame.size.height, frame.size.width, CV_8UC3,
                     const_cast<std::uint8_t*>(frame.bgr.data()));
  return view.size() == image.size() && image.type() == CV_8UC3 &&
         cv::norm(view, image, cv::NORM_INF) == 0;
}

}  // namespace eventgan::testing
