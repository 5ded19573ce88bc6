#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/frames/decoding/video_file.h"

namespace eventgan {

/// A window on one video: its latest frames, since pairs of close frames are asked for by turns.
/// Asking for an earlier one opens the video anew, which costs all the frames before it. What is
/// kept of a frame (its pixels, or less) is up to `keep`. Not thread safe.
template <class Kept>
class VideoWindow {
 public:
  using Keep = std::function<Kept(const ColourView&)>;

  /// Keeps the latest `most` frames (at least one). Throws std::runtime_error as VideoFile does.
  VideoWindow(std::filesystem::path path, int most, Keep keep)
      : path_(std::move(path)), most_(std::max(most, 1)), keep_(std::move(keep)), file_(path_) {}

  /// The frame at `position`, counted from 0; valid until the next call. Throws std::runtime_error
  /// as VideoFile does, or if the video ends before it.
  const Kept& frame(std::int64_t position) {
    if (position < first_kept()) {
      file_ = VideoFile(path_);
      latest_.clear();
    }
    // What will have left the window when `position` is reached is not even looked at.
    const std::int64_t first_wanted = position + 1 - most_;
    while (file_.position() <= position) {
      if (!(file_.position() < first_wanted ? skip() : keep_next())) {
        throw std::runtime_error("expected a frame at position " + std::to_string(position) +
                                 ", got a video whose frames end after " +
                                 std::to_string(file_.position()));
      }
    }
    return latest_[static_cast<std::size_t>(position - first_kept())];
  }

 private:
  std::int64_t first_kept() const {
    return file_.position() - static_cast<std::int64_t>(latest_.size());
  }

  bool skip() {
    latest_.clear();
    return file_.skip();
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
  VideoFile file_;
  std::deque<Kept> latest_;  ///< the frames just before file_.position(), in order
};

}  // namespace eventgan
