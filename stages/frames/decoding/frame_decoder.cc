#include "stages/frames/decoding/frame_decoder.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/video_frames.h"

namespace eventgan {

Outcome<ImageSize> probe_image_size(const std::filesystem::path& file,
                                    ImageOrientation orientation) {
  try {
    if (const InputFile opened = open_image_file(file); is_image(opened)) {
      return image_size(opened, orientation);
    }
    const auto size_of = [](const ColourView& frame) { return frame.size; };
    return VideoWindow<ImageSize>(file, 1, size_of).frame(0);
  } catch (const std::runtime_error& error) {
    return SampleFault{std::string(error.what()) + ", in " + file.string()};
  }
}

std::optional<ValueRange> narrow_value_range(const std::vector<LabelledFrame>& frames,
                                             const std::filesystem::path& base) {
  const std::size_t looked_at = std::min<std::size_t>(8, frames.size());
  std::vector<std::int64_t> counts(65536);
  for (std::size_t i = 0; i < looked_at; ++i) {
    const FrameRef& frame = frames[i * frames.size() / looked_at].frame;
    if (frame.video_frame >= 0 || frame.path.empty()) continue;
    try {
      if (!count_wide_values(open_image_file(base / frame.path), counts)) return std::nullopt;
    } catch (const std::runtime_error&) {  // who converts it says why
    }
  }
  const auto total = std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
  if (total == 0) return std::nullopt;
  const auto outside = [&](const auto& first, const auto& last) {
    std::int64_t seen = 0;
    const auto end = std::find_if(
        first, last, [&](std::int64_t count) { return (seen += count) > total / 1000; });
    return static_cast<double>(end - first);
  };
  const double low = outside(counts.begin(), counts.end());
  const double high = 65535 - outside(counts.rbegin(), counts.rend());
  if (high <= low || high - low >= 65536 / 4.0) return std::nullopt;
  const double room = std::max(1.0, std::round((high - low) / 4));
  return ValueRange{std::max(0.0, low - room), std::min(65535.0, high + room)};
}

Outcome<ImageSize> ImageSizes::of(const std::filesystem::path& file, ImageOrientation orientation) {
  auto& kept = kept_[static_cast<std::size_t>(orientation)];
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = kept.find(file.native()); found != kept.end()) return found->second;
  }
  const Outcome<ImageSize> size = probe_image_size(file, orientation);  // others need not wait
  const std::lock_guard lock(mutex_);
  return kept.try_emplace(file.native(), size).first->second;
}

namespace {

ColourFrame copy_of(const ColourView& frame) {
  return {frame.size, {frame.bgr, frame.bgr + 3 * frame.size.pixel_count()}};
}

}  // namespace

FrameDecoder::FrameDecoder(std::filesystem::path base, int kept_frames)
    : base_(std::move(base)),
      videos_(std::make_unique<OpenVideos<ColourFrame>>(kept_frames, copy_of)) {}

Outcome<ColourFrame> FrameDecoder::decode(const FrameRef& frame, std::int64_t video_stride,
                                          ImageOrientation orientation,
                                          const std::optional<ValueRange>& range) const {
  const std::filesystem::path path = base_ / frame.path;
  try {
    return frame.video_frame < 0 ? decode_image_file(path, orientation, range)
                                 : videos_->frames<1>(path, {frame.video_frame}, video_stride)[0];
  } catch (const std::runtime_error& error) {
    return SampleFault{std::string(error.what()) + ", in " + frame.path};
  }
}

}  // namespace eventgan
