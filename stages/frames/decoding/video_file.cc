#include "stages/frames/decoding/video_file.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <utility>

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
};

VideoFile::VideoFile(std::filesystem::path path, int kept_frames)
    : path_(std::move(path)),
      kept_frames_(static_cast<std::size_t>(std::max(kept_frames, 1))),
      capture_(std::make_unique<Capture>()) {
  open();
}

VideoFile::~VideoFile() = default;

void VideoFile::open() {
  latest_.clear();
  decoded_ = 0;
  if (!std::filesystem::exists(path_)) throw std::runtime_error("expected a file, got none");
  bool opened = false;
  try {
    opened = !is_text(path_) && capture_->video.open(path_.string(), cv::CAP_FFMPEG);
  } catch (const cv::Exception&) {
    opened = false;
  }
  if (!opened) throw std::runtime_error("expected a video, got a file that cannot be read as one");
}

bool VideoFile::decode_next() {
  cv::Mat picture;
  try {
    if (!capture_->video.read(picture)) return false;
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("expected a whole video, got " + exception.err);
  }
  if (picture.type() != CV_8UC3 || !picture.isContinuous()) {
    throw std::runtime_error("expected 8-bit colour frames, got others");
  }
  const ImageSize size{picture.rows, picture.cols};
  check_picture_size(size);
  latest_.push_back({size, {picture.data, picture.data + picture.total() * picture.elemSize()}});
  if (latest_.size() > kept_frames_) latest_.pop_front();
  ++decoded_;
  return true;
}

const ColourFrame& VideoFile::frame(std::int64_t position) {
  const auto first_kept = decoded_ - static_cast<std::int64_t>(latest_.size());
  if (position < first_kept) open();
  while (decoded_ <= position) {
    if (!decode_next()) {
      throw std::runtime_error("expected a frame at position " + std::to_string(position) +
                               ", got a video whose frames end after " + std::to_string(decoded_));
    }
  }
  return latest_[latest_.size() - static_cast<std::size_t>(decoded_ - position)];
}

}  // namespace eventgan
