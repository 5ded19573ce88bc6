#include "stages/frames/decoding/video_file.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>

#include "stages/frames/decoding/picture_limits.h"

namespace eventgan {
namespace {

/// FFmpeg takes plain text for a video (it draws the letters), so text is kept from it.
bool is_text(const std::filesystem::path& path) {
  std::array<char, 512> start{};
  std::ifstream stream(path, std::ios::binary);
  stream.read(start.data(), start.size());
  const auto end = start.begin() + stream.gcount();
  return std::find(start.begin(), end, '\0') == end;
}

}  // namespace

struct VideoFile::Capture {
  cv::VideoCapture video;
  cv::Mat picture;  ///< the latest frame
};

VideoFile::VideoFile(const std::filesystem::path& path) : capture_(std::make_unique<Capture>()) {
  if (!std::filesystem::exists(path)) throw std::runtime_error("expected a file, got none");
  bool opened = false;
  try {
    opened = !is_text(path) && capture_->video.open(path.string(), cv::CAP_FFMPEG);
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
  cv::Mat& picture = capture_->picture;
  try {
    if (!capture_->video.retrieve(picture)) {
      throw std::runtime_error("expected a whole video, got one whose frame " +
                               std::to_string(position_ - 1) + " cannot be read");
    }
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("expected a whole video, got " + exception.err);
  }
  if (picture.type() != CV_8UC3 || !picture.isContinuous()) {
    throw std::runtime_error("expected 8-bit colour frames, got others");
  }
  const ImageSize size{picture.rows, picture.cols};
  check_picture_size(size);
  return ColourView{size, picture.data};
}

}  // namespace eventgan
