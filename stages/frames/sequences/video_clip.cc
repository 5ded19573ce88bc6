#include "stages/frames/sequences/video_clip.h"

#include <cmath>
#include <opencv2/videoio.hpp>
#include <string>
#include <utility>

#include "manifests/faults.h"

namespace eventgan {
namespace {

/// Takes the frames' times, counted from the first, unless they are those of the clip's rate.
void take_times(std::vector<double> times_s, VideoClip& clip) {
  constexpr double kRounding_s = 1e-3;  // of containers that count milliseconds
  const double first = times_s.front();
  bool even = clip.frames_per_second.has_value();
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    times_s[i] -= first;
    clip.times_ascend = clip.times_ascend && (i == 0 || times_s[i] > times_s[i - 1]);
    even = even &&
           std::abs(times_s[i] - static_cast<double>(i) / *clip.frames_per_second) <= kRounding_s;
  }
  if (clip.times_ascend && !even) clip.uneven_times_s = std::move(times_s);
}

}  // namespace

double VideoClip::time_s(std::int64_t number) const {
  if (!uneven_times_s.empty()) return uneven_times_s.at(static_cast<std::size_t>(number));
  return frames_per_second ? static_cast<double>(number) / *frames_per_second
                           : std::numeric_limits<double>::quiet_NaN();
}

VideoClip measure_video(const std::filesystem::path& file, std::int64_t enough) try {
  cv::VideoCapture capture(file.string(), cv::CAP_FFMPEG);
  VideoClip clip;
  std::vector<double> times_s;
  while (clip.frame_count < enough && capture.isOpened() && capture.grab()) {
    ++clip.frame_count;
    times_s.push_back(capture.get(cv::CAP_PROP_POS_MSEC) / 1000);
  }
  if (clip.frame_count == 0) {
    throw InputError("expected a video, got no frames, in " + file.string());
  }
  const double announced = capture.get(cv::CAP_PROP_FRAME_COUNT);
  if (announced > 0 && announced < 1e12) {
    clip.announced_count = static_cast<std::int64_t>(announced);
  }
  const double rate = capture.get(cv::CAP_PROP_FPS);
  if (std::isfinite(rate) && rate > 0) clip.frames_per_second = rate;
  take_times(std::move(times_s), clip);
  return clip;
} catch (const cv::Exception& error) {
  throw InputError("expected a video, got \"" + std::string(error.what()) + "\", in " +
                   file.string());
}

}  // namespace eventgan
