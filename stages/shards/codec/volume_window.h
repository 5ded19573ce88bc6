#pragma once

#include "manifests/volume.h"

namespace eventgan {

/// Where given values lie in a volume: values [whole.channels(), content.height, content.width], C
/// order, their top left pixel at (y, x) of each channel. Around them are zeros (no events), as in
/// letterbox's borders.
struct VolumeWindow {
  VolumeShape whole;
  ImageSize content;
  int x = 0;
  int y = 0;

  std::size_t value_count() const {
    return static_cast<std::size_t>(whole.channels()) * content.pixel_count();
  }
};

}  // namespace eventgan
