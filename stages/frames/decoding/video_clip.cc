#include "stages/frames/decoding/video_clip.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/videos/video_file.h"

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
  VideoFile video(file);
  VideoClip clip;
  std::vector<double> times_s;
  while (clip.frame_count < enough && video.skip()) {
    ++clip.frame_count;
    times_s.push_back(video.time_s());
  }
  if (clip.frame_count == 0) throw std::runtime_error("expected a video, got no frames");
  clip.announced_count = video.announced_count();
  clip.frames_per_second = video.frames_per_second();
  take_times(std::move(times_s), clip);
  return clip;
} catch (const std::runtime_error& error) {
  throw InputError(error.what() + (", in " + file.string()));
}

}  // namespace eventgan
