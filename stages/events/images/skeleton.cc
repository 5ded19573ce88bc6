#include "stages/events/images/skeleton.h"

#include <algorithm>
#include <cctype>
#include <optional>
#include <string_view>

namespace eventgan {
namespace {

/// One place of the body under the names that datasets give it, in the form of `plain`.
using Names = std::vector<std::string_view>;

/// A line through the body; places that a skeleton does not have are passed over.
struct Chain {
  BodySide side;
  std::vector<Names> places;
};

// In Human3.6M's 32 joints a bone's name is at its upper end: "RightLeg" is the knee,
// "RightArm" the shoulder, and "RightShoulder" lies at the neck.
const std::vector<Chain>& chains() {
  static const std::vector<Chain> all{{BodySide::kMiddle,
                                       {{"pelvis", "hip", "hips", "root", "rootpelvis"},
                                        {"spine", "torso", "belly"},
                                        {"spine1", "thorax"},
                                        {"neck", "upperneck", "neckbase", "neckhead"},
                                        {"nose", "necknose", "jaw"},
                                        {"head", "headtop"},
                                        {"headsite"}}},
                                      {BodySide::kRight,
                                       {{"pelvis", "hip", "hips", "root", "rootpelvis"},
                                        {"rhip", "righthip", "rightupleg"},
                                        {"rknee", "rightknee", "rightleg"},
                                        {"rankle", "rightankle", "rfoot", "rightfoot"},
                                        {"righttoebase", "rtoe", "righttoe"}}},
                                      {BodySide::kLeft,
                                       {{"pelvis", "hip", "hips", "root", "rootpelvis"},
                                        {"lhip", "lefthip", "leftupleg"},
                                        {"lknee", "leftknee", "leftleg"},
                                        {"lankle", "leftankle", "lfoot", "leftfoot"},
                                        {"lefttoebase", "ltoe", "lefttoe"}}},
                                      {BodySide::kRight,
                                       {{"thorax", "neck"},
                                        {"rshoulder", "rightshoulder"},
                                        {"rightarm"},
                                        {"relbow", "rightelbow", "rightforearm"},
                                        {"rwrist", "rightwrist", "righthand"}}},
                                      {BodySide::kLeft,
                                       {{"thorax", "neck"},
                                        {"lshoulder", "leftshoulder"},
                                        {"leftarm"},
                                        {"lelbow", "leftelbow", "leftforearm"},
                                        {"lwrist", "leftwrist", "lefthand"}}}};
  return all;
}

/// Small letters and digits alone.
std::string plain(const std::string& name) {
  std::string result;
  for (const unsigned char letter : name) {
    if (std::isalnum(letter)) result += static_cast<char>(std::tolower(letter));
  }
  return result;
}

std::optional<int> find_place(const std::vector<std::string>& joints, const Names& names) {
  for (const std::string_view name : names) {
    const auto found = std::find(joints.begin(), joints.end(), name);
    if (found != joints.end()) return static_cast<int>(found - joints.begin());
  }
  return std::nullopt;
}

}  // namespace

std::vector<Limb> limbs_of(const std::vector<std::string>& joint_names) {
  std::vector<std::string> joints;
  for (const auto& name : joint_names) joints.push_back(plain(name));

  std::vector<Limb> limbs;
  for (const Chain& chain : chains()) {
    std::optional<int> from;
    for (const Names& names : chain.places) {
      const auto to = find_place(joints, names);
      if (!to) continue;
      if (from) limbs.push_back({*from, *to, chain.side});
      from = to;
    }
  }
  return limbs;
}

}  // namespace eventgan
