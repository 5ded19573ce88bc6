#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/values/recently_used.h"
#include "stages/base/images/image_file.h"
#include "stages/base/videos/video_file.h"

namespace eventgan {

/// A window on one video: its latest frames, since pairs of close frames are asked for by turns.
/// Asking for an earlier one opens the video again, which costs all the frames before it. Of a
/// video that is thinned those at multiples of `stride` count alone: others are passed over. What
/// is kept of a frame (its pixels, or less) is up to `keep`. Not thread safe.
template <class Kept>
class VideoWindow {
 public:
  using Keep = std::function<Kept(const ColourView&)>;

  /// Keeps the latest `most` frames (at least one). Throws std::runtime_error as VideoFile does.
  VideoWindow(std::filesystem::path path, int most, Keep keep, std::int64_t stride = 1)
      : path_(std::move(path)),
        most_(std::max(most, 1)),
        keep_(std::move(keep)),
        stride_(stride),
        file_(path_) {}

  /// The frame at `position`, counted from 0, a multiple of the stride; valid until the next call.
  /// Throws std::runtime_error as VideoFile does, or if the video ends before it.
  const Kept& frame(std::int64_t position) {
    if (position < first_kept()) {
      file_ = VideoFile(path_);
      latest_.clear();
    }
    // What will have left the window when `position` is reached is not even looked at.
    const std::int64_t first_wanted = position - (most_ - 1) * stride_;
    if (file_.position() < first_wanted) latest_.clear();
    while (file_.position() <= position) {
      const bool wanted = file_.position() >= first_wanted && file_.position() % stride_ == 0;
      if (!(wanted ? keep_next() : file_.skip())) {
        throw std::runtime_error("expected a frame at position " + std::to_string(position) +
                                 ", got a video whose frames end after " +
                                 std::to_string(file_.position()));
      }
    }
    return latest_[static_cast<std::size_t>((position - first_kept()) / stride_)];
  }

 private:
  std::int64_t first_kept() const {
    const std::int64_t behind = (file_.position() + stride_ - 1) / stride_;  // frames that count
    return latest_.empty() ? file_.position() : (behind - std::ssize(latest_)) * stride_;
  }

  bool keep_next() {
    try {
      const std::optional<ColourView> frame = file_.next();
      if (!frame) return false;
      latest_.push_back(keep_(*frame));
    } catch (...) {
      latest_.clear();  // a gap must not shift the frames' numbers
      throw;
    }
    if (std::ssize(latest_) > most_) latest_.pop_front();
    return true;
  }

  std::filesystem::path path_;
  std::int64_t most_;
  Keep keep_;
  std::int64_t stride_;
  VideoFile file_;
  std::deque<Kept> latest_;  ///< the frames that count just before file_.position(), in order
};

/// The videos used last, each with its latest frames. Thread safe: frames are decoded, and kept,
/// one after another under a lock.
template <class Kept>
class OpenVideos {
 public:
  using Keep = typename VideoWindow<Kept>::Keep;

  /// Of each of the two videos used last, the latest `kept_frames` are kept.
  OpenVideos(int kept_frames, Keep keep) : kept_frames_(kept_frames), keep_(std::move(keep)) {}

  /// Several frames of one video, with no other thread's frames in between, so that these cannot
  /// push the first one's neighbours out. Of a video from which each `stride`th is asked for, only
  /// these are kept. Throws std::runtime_error as VideoWindow does.
  template <std::size_t kCount>
  std::array<Kept, kCount> frames(const std::filesystem::path& path,
                                  const std::array<std::int64_t, kCount>& positions,
                                  std::int64_t stride = 1) {
    const std::lock_guard lock(mutex_);
    const auto video = videos_.get({path, stride}, [&] {
      return std::make_shared<VideoWindow<Kept>>(path, kept_frames_, keep_, stride);
    });
    std::array<Kept, kCount> frames;
    std::ranges::transform(positions, frames.begin(),
                           [&](std::int64_t position) { return video->frame(position); });
    return frames;
  }

 private:
  int kept_frames_;
  Keep keep_;
  std::mutex mutex_;
  RecentlyUsed<std::pair<std::filesystem::path, std::int64_t>, std::shared_ptr<VideoWindow<Kept>>>
      videos_{2};  ///< by path and stride
};

}  // namespace eventgan
