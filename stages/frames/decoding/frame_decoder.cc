#include "stages/frames/decoding/frame_decoder.h"

#include <algorithm>
#include <cstdint>
#include <list>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/frames/decoding/picture_file.h"
#include "stages/frames/decoding/video_file.h"

namespace eventgan {

/// The videos used last, most recent first.
class FrameDecoder::OpenVideos {
 public:
  explicit OpenVideos(int kept_frames) : kept_frames_(kept_frames) {}

  /// Several frames of one video under one lock.
  template <std::size_t kCount>
  std::array<ColourFrame, kCount> frames(const std::filesystem::path& path,
                                         const std::array<std::int64_t, kCount>& positions) {
    const std::lock_guard lock(mutex_);
    VideoFile& video = open(path);
    std::array<ColourFrame, kCount> frames;
    std::ranges::transform(positions, frames.begin(),
                           [&](std::int64_t position) { return video.frame(position); });
    return frames;
  }

 private:
  static constexpr std::size_t kMostOpen = 2;

  struct OpenVideo {
    OpenVideo(const std::filesystem::path& video_path, int kept_frames)
        : path(video_path), file(video_path, kept_frames) {}
    std::filesystem::path path;
    VideoFile file;
  };

  VideoFile& open(const std::filesystem::path& path) {
    const auto video = std::ranges::find(videos_, path, &OpenVideo::path);
    if (video != videos_.end()) {
      videos_.splice(videos_.begin(), videos_, video);
    } else {
      videos_.emplace_front(path, kept_frames_);
      if (videos_.size() > kMostOpen) videos_.pop_back();
    }
    return videos_.front().file;
  }

  int kept_frames_;
  std::mutex mutex_;
  std::list<OpenVideo> videos_;
};

FrameDecoder::FrameDecoder(std::filesystem::path base, int kept_frames)
    : base_(std::move(base)), videos_(std::make_unique<OpenVideos>(kept_frames)) {}

FrameDecoder::~FrameDecoder() = default;

Outcome<ColourFrame> FrameDecoder::decode(const FrameRef& frame) const {
  const std::filesystem::path path = base_ / frame.path;
  try {
    return frame.video_frame < 0 ? decode_picture_file(path)
                                 : videos_->frames<1>(path, {frame.video_frame})[0];
  } catch (const std::runtime_error& error) {
    return SampleFault{std::string(error.what()) + ", in " + frame.path};
  }
}

Outcome<std::array<ColourFrame, 2>> FrameDecoder::decode_both(const FrameRef& first,
                                                              const FrameRef& second) const {
  if (first.video_frame >= 0 && second.video_frame >= 0 && first.path == second.path) {
    try {
      return videos_->frames<2>(base_ / first.path, {first.video_frame, second.video_frame});
    } catch (const std::runtime_error& error) {
      return SampleFault{std::string(error.what()) + ", in " + first.path};
    }
  }
  Outcome<ColourFrame> one = decode(first);
  if (is_fault(one)) return std::get<SampleFault>(std::move(one));
  Outcome<ColourFrame> other = decode(second);
  if (is_fault(other)) return std::get<SampleFault>(std::move(other));
  return std::array{std::get<ColourFrame>(std::move(one)), std::get<ColourFrame>(std::move(other))};
}

}  // namespace eventgan
