#include "stages/frames/human36m/human36m_joints.h"

namespace eventgan {

std::vector<std::string> human36m_joint_names(std::size_t count) {
  if (count == 32) {
    return {"Hips",
            "RightUpLeg",
            "RightLeg",
            "RightFoot",
            "RightToeBase",
            "RightToeBase_Site",
            "LeftUpLeg",
            "LeftLeg",
            "LeftFoot",
            "LeftToeBase",
            "LeftToeBase_Site",
            "Spine",
            "Spine1",
            "Neck",
            "Head",
            "Head_Site",
            "LeftShoulder",
            "LeftArm",
            "LeftForeArm",
            "LeftHand",
            "LeftHandThumb",
            "LeftHandThumb_Site",
            "L_Wrist_End",
            "L_Wrist_End_Site",
            "RightShoulder",
            "RightArm",
            "RightForeArm",
            "RightHand",
            "RightHandThumb",
            "RightHandThumb_Site",
            "R_Wrist_End",
            "R_Wrist_End_Site"};
  }
  if (count == 17) {
    // Lists such as h36m_coco.json have the legs the other way round, which is an old mistake.
    return {"root (pelvis)", "right_hip",     "right_knee", "right_foot", "left_hip",
            "left_knee",     "left_foot",     "spine",      "thorax",     "neck_base",
            "head",          "left_shoulder", "left_elbow", "left_wrist", "right_shoulder",
            "right_elbow",   "right_wrist"};
  }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.push_back("joint_" + std::to_string(i));
  return names;
}

}  // namespace eventgan
