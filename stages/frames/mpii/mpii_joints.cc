#include "stages/frames/mpii/mpii_joints.h"

namespace eventgan {

const LabelSchema& mpii_label_schema() {
  static const LabelSchema schema{
      {},
      {"r_ankle", "r_knee", "r_hip", "l_hip", "l_knee", "l_ankle", "pelvis", "thorax", "upper_neck",
       "head_top", "r_wrist", "r_elbow", "r_shoulder", "l_shoulder", "l_elbow", "l_wrist"}};
  return schema;
}

}  // namespace eventgan
