#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "stages/base/images/image_file.h"

namespace eventgan {

/// One video (its file's first), decoded by FFmpeg from its start to its end: seeking in compressed
/// video is not exact, so a frame is found by counting. All throw std::runtime_error saying what is
/// wrong, without the file's name. Not thread safe; several may be read at once.
class VideoFile {
 public:
  explicit VideoFile(const std::filesystem::path& path);
  ~VideoFile();
  VideoFile(VideoFile&&) noexcept;
  VideoFile& operator=(VideoFile&&) noexcept;

  /// Passes the next frame over, which is cheaper than `next`; false at the video's end, and where
  /// it cannot be decoded further.
  bool skip();

  /// The next frame, as it is to be shown (a video that says so is turned by 90, 180 or 270
  /// degrees), valid until the next call; none where `skip` gives false. All are of one size.
  std::optional<ColourView> next();

  /// Frames behind, skipped ones and those that `next` threw for included.
  std::int64_t position() const { return position_; }

  /// When the latest frame is shown, in seconds from any time on; NaN if the file does not tell.
  double time_s() const;

  /// Frames that are shown, as the container says, often an estimate; 0 if it does not.
  std::int64_t announced_count() const;

  /// As the container says; none if it does not.
  std::optional<double> frames_per_second() const;

 private:
  struct Decoder;
  std::unique_ptr<Decoder> decoder_;
  std::int64_t position_ = 0;
};

/// "FFmpeg 5.1.6-0+deb12u1", as it runs.
std::string video_libraries();

/// Writes an MP4 (H.264, which browsers play) of the images that `next` gives, until it gives
/// none, each shown 1/frames_per_second seconds; all of the size of the first, whose odd sides get
/// a row or column of black. The file is under its name whole or not at all (atomic_file.h).
/// Returns how many. Throws std::runtime_error naming the path if it cannot be encoded or written,
/// and for none; and what `next` throws.
int write_video(const std::filesystem::path& path, double frames_per_second,
                const std::function<std::optional<ColourFrame>()>& next);

}  // namespace eventgan
