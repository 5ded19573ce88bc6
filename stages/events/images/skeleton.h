#pragma once

#include <string>
#include <vector>

namespace eventgan {

enum class BodySide { kMiddle, kLeft, kRight };  ///< the person's own left and right

/// A line between two joints, as indices into the joint names.
struct Limb {
  int from = 0;
  int to = 0;
  BodySide side = BodySide::kMiddle;
  bool operator==(const Limb&) const = default;
};

/// The limbs of a skeleton, told from its joints' names: MPII's ("r_ankle", "upper_neck" ..) and
/// Human3.6M's with 17 or 32 joints ("RKnee", "RightUpLeg" ..), in upper or lower case, with or
/// without separators. Names not known have no limbs.
std::vector<Limb> limbs_of(const std::vector<std::string>& joint_names);

}  // namespace eventgan
