#pragma once

#include <string>
#include <vector>

#include "manifests/image_size.h"
#include "manifests/volume.h"

namespace eventgan {

/// A pair of frames and the real event volume between them.
struct TrainingSample {
  VolumeShape shape;
  /// [frame, y, x] float32, C order, previous then next, in [-1, 1]: as recorded. The losses
  /// compare with these.
  std::vector<float> frames;
  /// The same with gain and gamma: what the networks see. Equal to `frames` without augmentation.
  std::vector<float> network_frames;
  /// [2 bins, y, x] float32, C order, normalised by η98, in [0, 1].
  std::vector<float> volume;
  std::string origin;  ///< for messages: recording, frames, crop
};

}  // namespace eventgan
