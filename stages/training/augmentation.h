#pragma once

#include "manifests/counter_random.h"
#include "manifests/training_manifest.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// What is done to one sample; drawn once, applied to frames and volume alike.
struct Augmentation {
  int top = 0;   ///< crop's first row
  int left = 0;  ///< crop's first column
  ImageSize crop;
  bool flip_x = false;  ///< left-right
  bool flip_y = false;  ///< up-down
  float gain = 1;       ///< ≥ 0
  float gamma = 1;      ///< > 0
};

/// Draws crop, flips, gain and gamma, each uniformly over what is possible; a function of its
/// arguments alone. Throws std::invalid_argument if the picture is smaller than the crop, or the
/// crop empty. Thread safe.
Augmentation draw_augmentation(ImageSize picture, ImageSize crop, const AugmentationSpec& spec,
                               CounterRandom random);

/// Cuts and flips frames and volume. A flip moves pixels only: polarity, time and the order of the
/// frames stay. The network frames are the cut frames with intensities
///
///   u' = min(1, gain · u^gamma),  u = (x + 1) / 2 in [0, 1],  x' = 2 u' - 1,
///
/// exactly the frames where gain and gamma are 1; `network_frames` of the input are not looked at.
/// A NaN stays one. The origin names the crop. Throws std::invalid_argument if the crop is empty or
/// leaves the sample, or the sample's arrays do not have its shape. Thread safe.
TrainingSample augment(const TrainingSample& sample, const Augmentation& augmentation);

}  // namespace eventgan
