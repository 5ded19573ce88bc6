#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>

#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// One video, decoded from its start: seeking in compressed video is not exact, so a frame is found
/// by counting. The latest frames are kept, since pairs of close frames are asked for by turns;
/// asking for an earlier one than those opens the video anew, which costs all the frames before it.
/// Not thread safe.
class VideoFile {
 public:
  /// Keeps the latest `kept_frames` (at least one). Throws std::runtime_error saying what is wrong,
  /// without the file's name, as `frame` does.
  VideoFile(std::filesystem::path path, int kept_frames);
  ~VideoFile();

  /// The frame at `position`, counted from 0; valid until the next call.
  const ColourFrame& frame(std::int64_t position);

 private:
  struct Capture;
  void open();
  bool decode_next();

  std::filesystem::path path_;
  std::size_t kept_frames_;
  std::unique_ptr<Capture> capture_;
  std::int64_t decoded_ = 0;        ///< frames decoded since opening
  std::deque<ColourFrame> latest_;  ///< the last of them in order
};

}  // namespace eventgan
