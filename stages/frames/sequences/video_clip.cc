#include "stages/frames/sequences/video_clip.h"

#include <cmath>
#include <opencv2/videoio.hpp>
#include <string>

#include "manifests/faults.h"

namespace eventgan {

VideoClip measure_video(const std::filesystem::path& file, std::int64_t enough) try {
  cv::VideoCapture capture(file.string(), cv::CAP_FFMPEG);
  VideoClip clip;
  while (clip.frame_count < enough && capture.isOpened() && capture.grab()) ++clip.frame_count;
  if (clip.frame_count == 0) {
    throw InputError("expected a video, got no frames, in " + file.string());
  }
  const double announced = capture.get(cv::CAP_PROP_FRAME_COUNT);
  if (announced > 0 && announced < 1e12) {
    clip.announced_count = static_cast<std::int64_t>(announced);
  }
  const double rate = capture.get(cv::CAP_PROP_FPS);
  if (std::isfinite(rate) && rate > 0) clip.frames_per_second = rate;
  return clip;
} catch (const cv::Exception& error) {
  throw InputError("expected a video, got \"" + std::string(error.what()) + "\", in " +
                   file.string());
}

}  // namespace eventgan
