#include "stages/events/images/image_output.h"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <vector>

#include "stages/base/files/atomic_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The image's pixels, for as long as it lives.
cv::Mat pixels_of(const ColourFrame& image) {
  return cv::Mat(image.size.height, image.size.width, CV_8UC3,
                 const_cast<std::uint8_t*>(image.bgr.data()));
}

std::string encoded(const cv::Mat& image, const char* type, const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes;
  cv::imencode(type, image, bytes, parameters);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

void write_png(const ColourFrame& image, const fs::path& path) {
  try {
    write_file_atomically(path, encoded(pixels_of(image), ".png", {}));
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw " + path.string() + ": " + exception.err);
  }
}

std::string jpeg_of(const ColourFrame& image, std::size_t most_bytes) {
  try {
    for (cv::Mat pixels = pixels_of(image);;
         cv::resize(pixels, pixels, {}, 0.5, 0.5, cv::INTER_AREA)) {
      for (const int quality : {85, 70, 50, 30}) {
        std::string jpeg = encoded(pixels, ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality});
        if (jpeg.size() <= most_bytes || pixels.rows < 2 || pixels.cols < 2) return jpeg;
      }
    }
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot encode an image: " + exception.err);
  }
}

namespace {

/// A temporary that goes if it is not renamed. FFmpeg tells the format by the file's ending, so it
/// has another name than AtomicFile's.
struct VideoPart {
  fs::path path;
  ~VideoPart() {
    std::error_code ignored;
    fs::remove(path, ignored);
  }
};

/// OpenCV tells of no write that fails: the video is read back, as far as its frames are counted.
void require_frames(const fs::path& part, int frames, const fs::path& path) {
  const cv::VideoCapture video(part.string(), cv::CAP_FFMPEG);
  const double got = video.isOpened() ? video.get(cv::CAP_PROP_FRAME_COUNT) : 0;
  if (got == frames) return;
  throw std::runtime_error("cannot write " + path.string() + ": expected " +
                           std::to_string(frames) + " frames, got " +
                           std::to_string(static_cast<int>(got)) + unsaid_reason(part));
}

}  // namespace

int write_video(const fs::path& path, double frames_per_second,
                const std::function<std::optional<ColourFrame>()>& next) try {
  AtomicFile file(path);
  const VideoPart part{file.temporary().string() + ".mp4"};
  cv::VideoWriter writer;
  cv::Mat padded;
  int frames = 0;
  while (const auto image = next()) {
    const cv::Mat pixels = pixels_of(*image);
    if (frames == 0) {
      padded = cv::Mat::zeros((pixels.rows + 1) / 2 * 2, (pixels.cols + 1) / 2 * 2, CV_8UC3);
      if (!writer.open(part.path.string(), cv::CAP_FFMPEG,
                       cv::VideoWriter::fourcc('a', 'v', 'c', '1'), frames_per_second,
                       padded.size())) {
        throw std::runtime_error("cannot write " + path.string() +
                                 ": FFmpeg cannot make an MP4 of H.264");
      }
    }
    pixels.copyTo(padded(cv::Rect({0, 0}, pixels.size())));
    writer.write(padded);
    ++frames;
  }
  if (frames == 0) throw std::runtime_error("cannot write " + path.string() + ": no images");
  writer.release();
  require_frames(part.path, frames, path);
  fs::rename(part.path, file.temporary());
  file.publish();
  return frames;
} catch (const cv::Exception& exception) {
  throw std::runtime_error("cannot write " + path.string() + ": " + exception.err);
}

}  // namespace eventgan
