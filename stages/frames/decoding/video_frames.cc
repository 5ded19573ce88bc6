#include "stages/frames/decoding/video_frames.h"

#include <algorithm>
#include <array>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <system_error>

#include "stages/base/files/input_file.h"
#include "stages/base/images/image_file.h"

namespace eventgan {
namespace {

/// FFmpeg takes plain text for a video (it draws the letters), so text is kept from it.
bool is_text(std::FILE* file) {
  std::array<char, 512> start{};
  const auto end = start.begin() + std::fread(start.data(), 1, start.size(), file);
  return std::find(start.begin(), end, '\0') == end;
}

}  // namespace

struct VideoFile::Capture {
  cv::VideoCapture video;
  cv::Mat image;  ///< the latest frame
};

VideoFile::VideoFile(const std::filesystem::path& path) : capture_(std::make_unique<Capture>()) {
  std::error_code unknown;
  if (!std::filesystem::exists(path, unknown))
    throw std::runtime_error("expected a file, got none");
  std::string reason;
  const InputFile file = open_input(path, reason);
  if (!file) throw std::runtime_error("expected a readable file, got '" + reason + "'");
  bool opened = false;
  try {
    opened = !is_text(file.get()) && capture_->video.open(path.string(), cv::CAP_FFMPEG);
  } catch (const cv::Exception&) {
    opened = false;
  }
  if (!opened) throw std::runtime_error("expected a video, got a file that cannot be read as one");
}

VideoFile::~VideoFile() = default;
VideoFile::VideoFile(VideoFile&&) noexcept = default;
VideoFile& VideoFile::operator=(VideoFile&&) noexcept = default;

bool VideoFile::skip() {
  try {
    if (!capture_->video.grab()) return false;
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("expected a whole video, got " + exception.err);
  }
  ++position_;
  return true;
}

std::optional<ColourView> VideoFile::next() {
  if (!skip()) return std::nullopt;
  cv::Mat& image = capture_->image;
  try {
    if (!capture_->video.retrieve(image)) {
      throw std::runtime_error("expected a whole video, got one whose frame " +
                               std::to_string(position_ - 1) + " cannot be read");
    }
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("expected a whole video, got " + exception.err);
  }
  if (image.type() != CV_8UC3 || !image.isContinuous()) {
    throw std::runtime_error("expected 8-bit colour frames, got others");
  }
  const ImageSize size{image.rows, image.cols};
  check_image_size(size);
  return ColourView{size, image.data};
}

}  // namespace eventgan
