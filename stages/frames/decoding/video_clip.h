#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <vector>

namespace eventgan {

/// What a video file holds.
struct VideoClip {
  std::int64_t frame_count = 0;      ///< that can be decoded, as far as they were counted
  std::int64_t announced_count = 0;  ///< as the container says, often an estimate; 0 if it does not
  std::optional<double> frames_per_second;  ///< as the container says; none if it does not
  /// When each frame is shown, in seconds since the first, strictly ascending; empty if the frames
  /// come at `frames_per_second`, or if the file does not tell (`times_ascend`).
  std::vector<double> uneven_times_s;
  bool times_ascend = true;  ///< false: the file's times cannot be, and none is taken

  /// When frame `number` is shown, in seconds; NaN if unknown.
  double time_s(std::int64_t number) const;
};

/// Counts the frames of a video by decoding it once to its end, since what containers say about
/// their own length is often an estimate, and notes when each is shown. Times within a millisecond
/// of an even rate are that rate's: some containers round to milliseconds. Takes about the time of
/// the decoding; `enough` > 0 frames end the count for a caller that needs no more. Throws
/// InputError if the video cannot be opened or has no frames. Thread safe.
VideoClip measure_video(const std::filesystem::path& file,
                        std::int64_t enough = std::numeric_limits<std::int64_t>::max());

}  // namespace eventgan
