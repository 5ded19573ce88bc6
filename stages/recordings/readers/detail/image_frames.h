#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {

struct ColourFrame;  // stages/base/images/image_file.h

/// Made grey (ITU-R BT.601). Of a grey image all three channels are one, and stay what they are;
/// else `has_colour` becomes true.
GreyImage grey_of(const ColourFrame& colour, bool& has_colour);

/// Frames that are image files. The first one, which tells the size, is read on opening.
class ImageFrames final : public FrameStore {
 public:
  /// As many times as files, at least one. Throws InputError if the first image cannot be read.
  ImageFrames(std::vector<std::filesystem::path> files, std::vector<double> times_s);

  ImageSize size() const { return size_; }
  const std::vector<double>& times_s() const override { return times_s_; }
  GreyImage read(std::int64_t index) const override;
  std::vector<std::string> notes() const override;

 private:
  GreyImage read_any_size(std::size_t index) const;

  std::vector<std::filesystem::path> files_;
  std::vector<double> times_s_;
  /// The first read in colour; -1: none yet.
  mutable std::atomic<std::ptrdiff_t> colour_frame_ = -1;
  ImageSize size_;
};

}  // namespace eventgan
