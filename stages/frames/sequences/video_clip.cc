#include "stages/frames/sequences/video_clip.h"

extern "C" {
#include <libavcodec/packet.h>
#include <libavformat/avformat.h>
}

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <memory>
#include <opencv2/videoio.hpp>
#include <string>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"

namespace eventgan {
namespace {

struct FormatCloser {
  void operator()(AVFormatContext* format) const { avformat_close_input(&format); }
};
struct PacketDeleter {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};

/// When the packets of the video are shown, in seconds from any time on, ascending; nothing is
/// decoded. Empty if the file does not tell.
std::vector<double> packet_times(const std::filesystem::path& file) {
  AVFormatContext* opened = nullptr;
  if (avformat_open_input(&opened, file.c_str(), nullptr, nullptr) < 0) return {};
  const std::unique_ptr<AVFormatContext, FormatCloser> format(opened);
  if (avformat_find_stream_info(opened, nullptr) < 0) return {};
  const int video = av_find_best_stream(opened, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (video < 0) return {};
  const double tick_s = av_q2d(opened->streams[video]->time_base);

  const std::unique_ptr<AVPacket, PacketDeleter> packet(av_packet_alloc());
  std::vector<double> times_s;
  while (packet && av_read_frame(opened, packet.get()) >= 0) {
    const bool shown = packet->stream_index == video && !(packet->flags & AV_PKT_FLAG_DISCARD);
    if (shown && packet->pts == AV_NOPTS_VALUE) return {};
    if (shown) times_s.push_back(static_cast<double>(packet->pts) * tick_s);
    av_packet_unref(packet.get());
  }
  std::ranges::sort(times_s);
  return times_s;
}

/// OpenCV has no times for the last frames, which the decoder holds back until the file's end if
/// frames are stored in another order than shown. They are those of the packets shown last.
void add_held_back(const std::filesystem::path& file, std::vector<double>& times_s) {
  constexpr double kTolerance_s = 1e-6;
  const auto latest = std::ranges::adjacent_find(times_s, std::ranges::greater_equal());
  if (latest == times_s.end()) return;
  const auto held = static_cast<std::size_t>(std::distance(latest, times_s.end())) - 1;
  const std::vector<double> packets_s = packet_times(file);
  if (packets_s.size() <= held) return;
  const auto same = packets_s.end() - static_cast<std::ptrdiff_t>(held) - 1;  // as `latest`
  const double difference = (*same - packets_s.front()) - (*latest - times_s.front());
  if (std::abs(difference) > kTolerance_s) return;
  std::transform(same + 1, packets_s.end(), latest + 1,
                 [&](double time_s) { return *latest + (time_s - *same); });
}

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
  if (std::string reason; !open_input(file, reason)) {
    throw InputError("expected a video, got '" + reason + "', in " + file.string());
  }
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
  add_held_back(file, times_s);
  take_times(std::move(times_s), clip);
  return clip;
} catch (const cv::Exception& error) {
  throw InputError("expected a video, got \"" + std::string(error.what()) + "\", in " +
                   file.string());
}

}  // namespace eventgan
