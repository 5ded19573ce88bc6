#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/base/images/image_file.h"

namespace eventgan::testing {

/// A video of 64x48 pixels whose frame i is plain grey of value 2 i; at most 128 frames.
inline void write_counting_video(const std::filesystem::path& path, int frames,
                                 double frames_per_second = 25) {
  cv::VideoWriter writer(path.string(), cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), frames_per_second,
                         cv::Size(64, 48));
  if (!writer.isOpened()) throw std::runtime_error("cannot write " + path.string());
  for (int i = 0; i < frames; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(2 * i)));
}

/// An element of Matroska (RFC 8794): its id, its size in eight bytes, its content.
inline std::string matroska_element(std::string_view id, const std::string& content) {
  std::string element(id);
  element += '\x01';
  for (int shift = 48; shift >= 0; shift -= 8) {
    element += static_cast<char>(content.size() >> shift & 0xff);
  }
  return element + content;
}

/// Such a video as Matroska (RFC 9559) of JPEG images, frame i shown at times_ms[i], at most
/// 32767 milliseconds after the first: OpenCV writes even times alone. It lasts a whole number of
/// seconds, or as long as the file does not say.
inline void write_timed_video(const std::filesystem::path& path, const std::vector<int>& times_ms,
                              int duration_s = 0) {
  using namespace std::string_literals;
  const auto element = matroska_element;
  std::string cluster = element("\xE7", "\0"s);  // Timestamp
  for (std::size_t i = 0; i < times_ms.size(); ++i) {
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(2.0 * static_cast<double>(i))),
                 jpeg);
    std::string block = "\x81"s;  // track 1
    block += static_cast<char>(times_ms[i] >> 8);
    block += static_cast<char>(times_ms[i] & 0xff);
    block += '\x80';                                                     // a key frame
    cluster += element("\xA3", block.append(jpeg.begin(), jpeg.end()));  // SimpleBlock
  }
  const std::string header = element("\x42\x82", "matroska");   // DocType
  std::string info = element("\x2A\xD7\xB1", "\x0F\x42\x40"s);  // a tick is 10^6 ns
  if (duration_s > 0) {
    const auto bits = std::bit_cast<std::uint32_t>(1000.0f * static_cast<float>(duration_s));
    std::string ticks;
    for (int shift = 24; shift >= 0; shift -= 8) ticks += static_cast<char>(bits >> shift & 0xff);
    info += element("\x44\x89", ticks);
  }
  const std::string size = element("\xB0", "\x40") + element("\xBA", "\x30");  // 64 x 48
  const std::string track = element("\xD7", "\x01") + element("\x73\xC5", "\x01") +
                            element("\x83", "\x01") + element("\x86", "V_MJPEG") +
                            element("\xE0", size);  // number, UID, type, codec, video
  std::ofstream(path, std::ios::binary)
      << element("\x1A\x45\xDF\xA3", header)
      << element("\x18\x53\x80\x67", element("\x15\x49\xA9\x66", info) +
                                         element("\x16\x54\xAE\x6B", element("\xAE", track)) +
                                         element("\x1F\x43\xB6\x75", cluster));
}

/// The number of a frame of such a video.
inline int counted(const ColourFrame& frame) {
  return static_cast<int>(std::lround(frame.bgr.at(frame.bgr.size() / 2) / 2.0));
}

inline FrameRef video_ref(const std::string& path, int position) {
  FrameRef frame;
  frame.path = path;
  frame.video_frame = position;
  return frame;
}

}  // namespace eventgan::testing
