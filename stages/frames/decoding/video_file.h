#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// One video, decoded from its start to its end: seeking in compressed video is not exact, so a
/// frame is found by counting. All throw std::runtime_error saying what is wrong, without the
/// file's name. Not thread safe.
class VideoFile {
 public:
  explicit VideoFile(const std::filesystem::path& path);
  ~VideoFile();
  VideoFile(VideoFile&&) noexcept;
  VideoFile& operator=(VideoFile&&) noexcept;

  /// Passes the next frame over, which is cheaper than `next`; false at the video's end.
  bool skip();

  /// The next frame, valid until the next call; none at the video's end.
  std::optional<ColourView> next();

  /// Frames behind, skipped ones and those that `next` threw for included.
  std::int64_t position() const { return position_; }

 private:
  struct Capture;
  std::unique_ptr<Capture> capture_;
  std::int64_t position_ = 0;
};

}  // namespace eventgan
