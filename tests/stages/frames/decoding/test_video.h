#pragma once

#include <cmath>
#include <filesystem>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>

#include "manifests/pairs.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan::testing {

/// A video of 64x48 pixels whose frame i is plain grey of value 2 i; at most 128 frames.
inline void write_counting_video(const std::filesystem::path& path, int frames) {
  cv::VideoWriter writer(path.string(), cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, cv::Size(64, 48));
  if (!writer.isOpened()) throw std::runtime_error("cannot write " + path.string());
  for (int i = 0; i < frames; ++i) writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(2 * i)));
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
