#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <list>
#include <mutex>
#include <utility>

#include "stages/frames/decoding/video_window.h"

namespace eventgan {

/// The videos used last, each with its latest frames. Thread safe: frames are decoded, and kept,
/// one after another under a lock.
template <class Kept>
class OpenVideos {
 public:
  using Keep = typename VideoWindow<Kept>::Keep;

  /// Of each of the two videos used last, the latest `kept_frames` are kept.
  OpenVideos(int kept_frames, Keep keep) : kept_frames_(kept_frames), keep_(std::move(keep)) {}

  /// Several frames of one video, with no other thread's frames in between, so that these cannot
  /// push the first one's neighbours out. Throws std::runtime_error as VideoWindow does.
  template <std::size_t kCount>
  std::array<Kept, kCount> frames(const std::filesystem::path& path,
                                  const std::array<std::int64_t, kCount>& positions) {
    const std::lock_guard lock(mutex_);
    VideoWindow<Kept>& video = open(path);
    std::array<Kept, kCount> frames;
    std::ranges::transform(positions, frames.begin(),
                           [&](std::int64_t position) { return video.frame(position); });
    return frames;
  }

 private:
  static constexpr std::size_t kMostOpen = 2;

  struct OpenVideo {
    OpenVideo(const std::filesystem::path& video_path, int kept_frames, const Keep& keep)
        : path(video_path), window(video_path, kept_frames, keep) {}
    std::filesystem::path path;
    VideoWindow<Kept> window;
  };

  VideoWindow<Kept>& open(const std::filesystem::path& path) {
    const auto video = std::ranges::find(videos_, path, &OpenVideo::path);
    if (video != videos_.end()) {
      videos_.splice(videos_.begin(), videos_, video);
    } else {
      videos_.emplace_front(path, kept_frames_, keep_);
      if (videos_.size() > kMostOpen) videos_.pop_back();
    }
    return videos_.front().window;
  }

  int kept_frames_;
  Keep keep_;
  std::mutex mutex_;
  std::list<OpenVideo> videos_;  ///< most recently used first
};

}  // namespace eventgan
