#include "stages/base/images/image_file.h"

#include <stdlib.h>

#include <array>
#include <cstdio>
#include <iostream>
#include <memory>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <streambuf>
#include <string>
#include <string_view>
#include <system_error>

#include "stages/base/images/image_codecs.h"

namespace eventgan {

void check_image_size(ImageSize size) {
  if (size.height > 0 && size.width > 0 && size.pixel_count() <= kMaxImagePixels) return;
  throw std::runtime_error("a size of " + to_string(size) + ", not 1 to " +
                           std::to_string(kMaxImagePixels) + " pixels");
}

namespace {

enum class Format { kJpeg, kPng, kOther, kNone };

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using OpenFile = std::unique_ptr<std::FILE, FileCloser>;

OpenFile open_file(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) throw std::runtime_error("expected a file, got none");
  if (!std::filesystem::is_regular_file(status)) {
    throw std::runtime_error("expected a file, got a folder or device");
  }
  OpenFile file(std::fopen(path.c_str(), "rb"));
  if (file == nullptr) throw std::runtime_error("expected a readable file, got no permission");
  return file;
}

thread_local bool in_opencv = false;

/// OpenCV tells std::cerr itself, past its own log, what it could not decode. Stands before
/// std::cerr's buffer and drops what a thread writes while it is in OpenCV.
class WithoutOpencv final : public std::streambuf {
 public:
  explicit WithoutOpencv(std::streambuf* target) : target_(target) {}

 protected:
  int_type overflow(int_type character) override {
    if (in_opencv || character == traits_type::eof()) return traits_type::not_eof(character);
    return target_->sputc(traits_type::to_char_type(character));
  }
  std::streamsize xsputn(const char* text, std::streamsize length) override {
    return in_opencv ? length : target_->sputn(text, length);
  }
  int sync() override { return in_opencv ? 0 : target_->pubsync(); }

 private:
  std::streambuf* target_;
};

/// In its scope the calling thread is in OpenCV.
struct OpencvScope {
  OpencvScope() { in_opencv = true; }
  ~OpencvScope() { in_opencv = false; }
};

bool opencv_knows(const std::filesystem::path& file) {
  try {
    return cv::haveImageReader(file.string());
  } catch (const cv::Exception&) {
    return false;
  }
}

/// Leaves `file` at its start.
Format format_of(std::FILE* file, const std::filesystem::path& path) {
  std::array<char, 8> start{};
  const std::size_t length = std::fread(start.data(), 1, start.size(), file);
  if (length == 0) throw std::runtime_error("expected an image, got an empty file");
  std::rewind(file);
  const std::string_view bytes(start.data(), length);
  if (bytes.starts_with("\xff\xd8\xff")) return Format::kJpeg;
  if (bytes == "\x89PNG\r\n\x1a\n") return Format::kPng;
  return opencv_knows(path) ? Format::kOther : Format::kNone;
}

ColourFrame decode_with_opencv(const std::filesystem::path& file) {
  cv::Mat image;
  const OpencvScope scope;
  try {
    image = cv::imread(file.string(), cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& exception) {
    throw std::runtime_error(exception.err);
  }
  if (image.empty()) throw std::runtime_error("a damaged one");
  const ImageSize size{image.rows, image.cols};
  check_image_size(size);
  return {size, {image.data, image.data + image.total() * image.elemSize()}};
}

/// Calls the one of three readers that fits the file, and completes their errors.
template <class Jpeg, class Png, class Other>
auto read_by_format(const std::filesystem::path& path, Jpeg jpeg, Png png, Other other) {
  const OpenFile file = open_file(path);
  const Format format = format_of(file.get(), path);
  if (format == Format::kNone) {
    throw std::runtime_error("expected an image, got a file of another kind");
  }
  try {
    if (format == Format::kJpeg) return jpeg(file.get());
    if (format == Format::kPng) return png(file.get());
    return other(path);
  } catch (const std::runtime_error& error) {
    const char* name = format == Format::kJpeg ? "JPEG" : format == Format::kPng ? "PNG" : "image";
    throw std::runtime_error(std::string("expected a whole ") + name + ", got " + error.what());
  }
}

}  // namespace

void silence_decoders() {
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);  // quiet
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
  // Never deleted, since std::cerr is in use to the program's end.
  static auto* const without_opencv = new WithoutOpencv(std::cerr.rdbuf());
  std::cerr.rdbuf(without_opencv);
}

bool is_image_file(const std::filesystem::path& file) {
  return format_of(open_file(file).get(), file) != Format::kNone;
}

ColourFrame decode_image_file(const std::filesystem::path& file) {
  return read_by_format(file, decode_jpeg, decode_png, decode_with_opencv);
}

ImageSize image_file_size(const std::filesystem::path& file) {
  return read_by_format(file, jpeg_size, png_size, [](const std::filesystem::path& path) {
    return decode_with_opencv(path).size;
  });
}

}  // namespace eventgan
