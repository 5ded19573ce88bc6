#include <string>

#include "stages/frames/mpii/json_refusal_internal.h"
#include "stages/frames/mpii/mpii_joints.h"
#include "stages/frames/mpii/mpii_list_row_internal.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

Point parse_point(const Json& pair, const Point& missing, const std::string& where) {
  if (!pair.is_array() || pair.size() != 2 || !pair[0].is_number() || !pair[1].is_number()) {
    refuse_json(where, "two finite numbers", pair);
  }
  const Point point{pair[0].get<double>(), pair[1].get<double>()};
  if (point == missing) return kMissingPoint;
  return {point.x - 1, point.y - 1};
}

int parse_visible(const Json& value, const std::string& where) {
  if (value == 1 || value == true) return 1;
  if (value == 0 || value == false) return 0;
  refuse_json(where, "0 or 1", value);
}

const Json& joint_array(const Json& row, const char* name) {
  const Json& array = row.at(name);
  if (!array.is_array() || array.size() != kMpiiJointCount) refuse_json(name, "16 elements", array);
  return array;
}

}  // namespace

const char* image_field(MpiiListForm form) {
  return form == MpiiListForm::kTable ? "imgname" : "image";
}

Person parse_mpii_list_row(const Json& row, MpiiListForm form) {
  const bool is_table = form == MpiiListForm::kTable;
  const char* const joints_name = is_table ? "part" : "joints";
  const char* const visible_name = is_table ? "visible" : "joints_vis";
  const Point missing_joint = is_table ? Point{0, 0} : Point{-1, -1};

  Person person;
  person.joints.assign(kMpiiJointCount, Joint{kMissingPoint, 0});
  if (row.contains("center")) person.center = parse_point(row["center"], {-1, -1}, "center");
  if (row.contains("scale")) {
    if (!row["scale"].is_number()) refuse_json("scale", "a finite number", row["scale"]);
    person.scale = row["scale"].get<double>();
  }
  if (!row.contains(joints_name)) return person;

  const Json& joints = joint_array(row, joints_name);
  const Json* visible = row.contains(visible_name) ? &joint_array(row, visible_name) : nullptr;
  for (std::size_t i = 0; i < kMpiiJointCount; ++i) {
    const std::string place = "[" + std::to_string(i) + "]";
    Joint& joint = person.joints[i];
    joint.at = parse_point(joints[i], missing_joint, joints_name + place);
    const int seen = visible == nullptr ? -1 : parse_visible((*visible)[i], visible_name + place);
    joint.visible = joint.at == kMissingPoint ? 0 : seen;
  }
  return person;
}

}  // namespace eventgan
