#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace eventgan {

/// Labels by frame number.
using VideoLabels = std::map<std::int64_t, std::string>;

/// Reads a video's labels: a JSON object (comments allowed) from frame number ("12", leading zeros
/// allowed) to any JSON value, given here as compact text, object keys in their order. Nothing if
/// the file is a manifest of this program, which a user may well name as the video. Throws
/// InputError naming the file and `video` if it cannot be read, is no such object, or names a frame
/// twice.
std::optional<VideoLabels> read_video_labels(const std::filesystem::path& file,
                                             const std::string& video);

}  // namespace eventgan
