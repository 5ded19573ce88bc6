#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/labels.h"

namespace eventgan {

/// The joints of a source that are exported: the 17 in common use where the source has more and
/// says which these are (LabelSchema::joint_aliases), else all.
struct JointChoice {
  std::vector<std::size_t> indices;  ///< into LabelSchema::joint_names, ascending
  std::vector<std::string> names;    ///< of each; of the 17 their common names
};
JointChoice choose_joints(const LabelSchema& schema);

/// A person in volume pixels, counted from 0, as the lists below have it.
struct ListedPerson {
  Point center;
  double scale = 0;           ///< height / 200 px
  std::vector<Point> joints;  ///< chosen ones; kMissingPoint if not annotated
  std::optional<Rectangle> head_box;
};

inline constexpr char kNoCentre[] = "no centre or no scale";

/// Why a list has no use for a person; empty if it has.
std::string why_not_listed(const VolumePerson& person, const JointChoice& choice);

/// The person, if why_not_listed says nothing.
ListedPerson listed_person(const VolumePerson& person, const JointChoice& choice);

/// An entry of the list that Microsoft's pose_resnet reads as MPII: `joints` and `center` counted
/// from 1, (-1, -1) for a joint that is not annotated, `joints_vis` 1 where annotated. Thread safe.
std::string mpii_entry(const std::string& image, const ListedPerson& person);

/// The true joints of one list, to measure PCKh with.
class PckhTruth {
 public:
  /// `joint_names` as JointChoice has them.
  explicit PckhTruth(const std::vector<std::string>& joint_names);

  /// The next person of the list. The head box is its own; without one, a square about the middle
  /// of its neck and its head's top, whose diagonal is the distance of the two / 0.6, so that the
  /// head's size (PCKh: 0.6 of the diagonal) is this distance. False if there is neither: then all
  /// its joints count as missing, and the box is of size 1.
  bool add(const ListedPerson& person);

  bool is_empty() const { return head_boxes_.empty(); }

  /// Of one person at least: gt_NAME.mat (MATLAB 5): `dataset_joints` {1, J} in MPII's short names
  /// ("rank", "head"; of joints that MPII does not have, their own), `jnt_missing` [J, N],
  /// `pos_gt_src` [J, 2, N] and `headboxes_src` [corner, x or y, N] in volume pixels counted from
  /// 1, all double. Published whole. Throws std::runtime_error naming the path.
  void write(const std::filesystem::path& file) const;

 private:
  std::vector<std::string> short_names_;
  std::vector<double> missing_, positions_, head_boxes_;  ///< in MATLAB's order, first index first
};

}  // namespace eventgan
