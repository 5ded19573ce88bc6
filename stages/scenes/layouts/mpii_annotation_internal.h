#pragma once

#include <string>
#include <vector>

#include "stages/scenes/figure/figure_scene.h"
#include "stages/scenes/layouts/mat_values_internal.h"

namespace eventgan {

/// One picture of the annotation list.
struct DemoMpiiEntry {
  std::string name;  ///< "000000001": of the picture, and of the folder with its sequence
  int video = 0;     ///< counted from 1
  bool train = true;
  std::vector<FigureLabel> people;
};

/// The variable RELEASE of mpii_human_pose_v1_u12_1.mat.
MatValue mpii_release(const std::vector<DemoMpiiEntry>& entries);

/// The variable annolist_keyframes of mpii_human_pose_v1_sequences_keyframes.mat; `key_frame` is
/// the number of the annotated frame in every sequence.
MatValue mpii_keyframes(const std::vector<DemoMpiiEntry>& entries, int key_frame);

}  // namespace eventgan
