#pragma once

#include <optional>
#include <string>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/sensor_input.h"
#include "manifests/values/training.h"

namespace eventgan {

/// A pair of frames and the real event volume between them.
struct TrainingSample {
  VolumeShape shape;
  /// [frame, y, x] float32, C order, previous then next, in [-1, 1]: as recorded. The losses
  /// compare with these.
  std::vector<float> frames;
  /// The same with gain and gamma: what the networks see. Equal to `frames` without augmentation.
  std::vector<float> network_frames;
  /// [2 bins, y, x] float32, C order: normalised by η98, in [0, 1]; of a network that knows its
  /// sensor, as it is.
  std::vector<float> volume;
  /// The sensor's in the network frames' log intensity; none unless the network knows its sensor.
  std::optional<ContrastThreshold> threshold = std::nullopt;
  std::string origin;  ///< for messages: recording, frames, crop
  /// [2 bins, y, x] float32, C order, ≥ 0: the rates that a teacher gives for the network frames.
  /// Empty without one.
  std::vector<float> taught_rates = {};
};

/// What is done to one sample; drawn once, applied to frames and volume alike.
struct Augmentation {
  int top = 0;   ///< crop's first row
  int left = 0;  ///< crop's first column
  ImageSize crop;
  bool flip_x = false;   ///< left-right
  bool flip_y = false;   ///< up-down
  bool reverse = false;  ///< in time
  float gain = 1;        ///< ≥ 0
  float gamma = 1;       ///< > 0
};

/// Draws crop, flips, gain and gamma, each uniformly over what is possible; a function of its
/// arguments alone. Throws std::invalid_argument if the image is smaller than the crop, or the
/// crop empty. Thread safe.
Augmentation draw_augmentation(ImageSize image, ImageSize crop, const AugmentationSpec& spec,
                               CounterRandom random);

/// Cuts, flips and reverses frames and volume. A flip moves pixels only: polarity, time and the
/// order of the frames stay. In reversed time the frames change places, and so do the polarities,
/// since what got brighter gets darker; the first bin is the last. The network frames are the cut
/// frames with intensities
///
///   u' = min(1, gain · u^gamma),  u = (x + 1) / 2 in [0, 1],  x' = 2 u' - 1,
///
/// exactly the frames where gain and gamma are 1; a threshold grows by gamma, as contrasts do, and
/// in reversed time the ratio of its polarities is turned over.
/// `network_frames` of the input are not looked at.
/// A NaN stays one. The origin names the crop. Throws std::invalid_argument if the crop is empty or
/// leaves the sample, or the sample's arrays do not have its shape. Thread safe.
TrainingSample augment(const TrainingSample& sample, const Augmentation& augmentation);

}  // namespace eventgan
