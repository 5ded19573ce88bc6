#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/placement.h"
#include "manifests/values/simulation.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/frame_decoder.h"

namespace eventgan {

/// ITU-R BT.601, 8 bit. Throws InputError if OpenCV refuses it. Thread safe, as all of these.
GreyImage grey_image(const ColourFrame& frame);

/// A frame as a simulated sensor of `size` sees it: scaled to cover the sensor, averaging over
/// areas when it shrinks and bilinear when it grows, cut around the centre. Without a size: as it
/// is. No blur, which would take away the contrast that makes events. Throws InputError if it
/// cannot be resized.
GreyImage sensor_image(const GreyImage& frame, std::optional<ImageSize> size);

/// Where frames of this size lie in it. Throws std::invalid_argument for an empty frame.
Placement sensor_placement(ImageSize frame, std::optional<ImageSize> size);

/// The frames of a clip that a simulation uses: every `frame_step`-th from `first_frame` on of a
/// video, or of a folder of images in the order of their numbers or names. Not thread safe.
class ClipFrames {
 public:
  /// Lists the folder, or decodes the video once to count its frames, no further than the source
  /// reaches. Throws InputError "expected X, got Y, in PATH" if there is no clip or it has fewer
  /// frames than the source asks for.
  ClipFrames(const SimulationSource& source, const SimulationManifest& manifest);

  std::int64_t count() const { return static_cast<std::int64_t>(frames_.size()); }

  /// Seconds since the first of these frames; strictly ascending. Where a folder's numbers leave
  /// some out, time leaves them out too.
  double time_s(std::int64_t position) const { return frames_[at(position)].time_s; }

  /// A frame as the sensor sees it (sensor_image). Videos are decoded in order: ask likewise.
  /// Throws InputError if it cannot be decoded or is not as large as the first.
  GreyImage frame(std::int64_t position);

  /// The number of the frame within its clip, counted from 0.
  std::int64_t number(std::int64_t position) const { return frames_[at(position)].index; }

  /// Frames per second of the clip, all frames counted: the source's, else the video's, else 30.
  double rate_hz() const { return rate_hz_; }

  /// What the clip consists of: names and sizes of its files, hashed.
  const std::string& files_hash() const { return files_hash_; }

 private:
  static std::size_t at(std::int64_t position) { return static_cast<std::size_t>(position); }

  std::filesystem::path path_;
  std::optional<ImageSize> size_;
  std::optional<ImageSize> frame_size_;  ///< of the first frame read
  double rate_hz_ = 0;
  std::vector<FrameRef> frames_;
  std::string files_hash_;
  FrameDecoder decoder_;
};

}  // namespace eventgan
