#include "stages/exports/pose_list.h"

#include <matio.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/atomic_file.h"

namespace eventgan {

JointChoice choose_joints(const LabelSchema& schema) {
  JointChoice choice;
  const std::vector<std::string>& aliases = schema.joint_aliases;
  for (std::size_t i = 0; i < schema.joint_names.size(); ++i) {
    if (!aliases.empty() && aliases[i].empty()) continue;
    choice.indices.push_back(i);
    choice.names.push_back(aliases.empty() ? schema.joint_names[i] : aliases[i]);
  }
  return choice;
}

std::string why_not_listed(const VolumePerson& person, const JointChoice& choice) {
  if (person.center == kMissingPoint || person.scale <= 0) return kNoCentre;
  const bool has_joint = std::ranges::any_of(
      choice.indices, [&](std::size_t i) { return person.joints.at(i) != kMissingPoint; });
  return has_joint ? "" : "no joint annotated";
}

ListedPerson listed_person(const VolumePerson& person, const JointChoice& choice) {
  ListedPerson listed{person.center, person.scale, {}, person.head_box};
  for (const std::size_t i : choice.indices) listed.joints.push_back(person.joints.at(i));
  return listed;
}

namespace {

/// MATLAB counts from 1.
Point one_based(Point point) {
  return point == kMissingPoint ? point : Point{point.x + 1, point.y + 1};
}

}  // namespace

std::string mpii_entry(const std::string& image, const ListedPerson& person) {
  nlohmann::ordered_json joints = nlohmann::ordered_json::array();
  nlohmann::ordered_json annotated = nlohmann::ordered_json::array();
  for (const Point joint : person.joints) {
    const Point at = one_based(joint);
    joints.push_back({at.x, at.y});
    annotated.push_back(joint == kMissingPoint ? 0 : 1);
  }
  const Point center = one_based(person.center);
  return dump_json(nlohmann::ordered_json{{"joints_vis", std::move(annotated)},
                                          {"joints", std::move(joints)},
                                          {"image", image},
                                          {"scale", person.scale},
                                          {"center", {center.x, center.y}}});
}

namespace {

/// MPII's names and those of Human3.6M's 17 joints, in the short form of MPII's own evaluation.
std::string short_name(const std::string& name) {
  static constexpr std::pair<std::string_view, std::string_view> kNames[] = {
      {"r_ankle", "rank"},        {"right_foot", "rank"},    {"r_knee", "rkne"},
      {"right_knee", "rkne"},     {"r_hip", "rhip"},         {"right_hip", "rhip"},
      {"l_hip", "lhip"},          {"left_hip", "lhip"},      {"l_knee", "lkne"},
      {"left_knee", "lkne"},      {"l_ankle", "lank"},       {"left_foot", "lank"},
      {"pelvis", "pelv"},         {"root (pelvis)", "pelv"}, {"thorax", "thor"},
      {"upper_neck", "neck"},     {"neck_base", "neck"},     {"head_top", "head"},
      {"head", "head"},           {"r_wrist", "rwri"},       {"right_wrist", "rwri"},
      {"r_elbow", "relb"},        {"right_elbow", "relb"},   {"r_shoulder", "rsho"},
      {"right_shoulder", "rsho"}, {"l_shoulder", "lsho"},    {"left_shoulder", "lsho"},
      {"l_elbow", "lelb"},        {"left_elbow", "lelb"},    {"l_wrist", "lwri"},
      {"left_wrist", "lwri"}};
  for (const auto& [known, brief] : kNames) {
    if (name == known) return std::string(brief);
  }
  return name;
}

}  // namespace

PckhTruth::PckhTruth(const std::vector<std::string>& joint_names) {
  for (const std::string& name : joint_names) short_names_.push_back(short_name(name));
}

namespace {

constexpr double kHeadShare = 0.6;  // SC_BIAS of MPII's evaluation

std::optional<Rectangle> head_of(const ListedPerson& person,
                                 const std::vector<std::string>& short_names) {
  if (person.head_box) return person.head_box;
  const auto joint = [&](std::string_view name) {
    const auto at = std::ranges::find(short_names, name);
    return at == short_names.end()
               ? kMissingPoint
               : person.joints[static_cast<std::size_t>(std::distance(short_names.begin(), at))];
  };
  const Point neck = joint("neck");
  const Point head = joint("head");
  if (neck == kMissingPoint || head == kMissingPoint || neck == head) return std::nullopt;
  const double half_side =
      std::hypot(head.x - neck.x, head.y - neck.y) / kHeadShare / std::sqrt(2.0) / 2;
  const Point middle{(head.x + neck.x) / 2, (head.y + neck.y) / 2};
  return Rectangle{middle.x - half_side, middle.y - half_side, middle.x + half_side,
                   middle.y + half_side};
}

}  // namespace

bool PckhTruth::add(const ListedPerson& person) {
  const std::optional<Rectangle> head = head_of(person, short_names_);
  for (const Point joint : person.joints) {
    missing_.push_back(head && joint != kMissingPoint ? 0 : 1);
  }
  for (const Point joint : person.joints) positions_.push_back(one_based(joint).x);
  for (const Point joint : person.joints) positions_.push_back(one_based(joint).y);
  const Rectangle box = head.value_or(Rectangle{0, 0, 1, 1});
  head_boxes_.insert(head_boxes_.end(), {box.left + 1, box.right + 1, box.top + 1, box.bottom + 1});
  return head.has_value();
}

namespace {

struct FreeMat {
  void operator()(matvar_t* value) const { Mat_VarFree(value); }
};
struct CloseMat {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
using MatValue = std::unique_ptr<matvar_t, FreeMat>;
using MatFile = std::unique_ptr<mat_t, CloseMat>;

MatValue mat_value(const char* name, matio_classes kind, matio_types stored,
                   std::vector<std::size_t> sizes, const void* data) {
  // matio copies the data: its parameter is not const, and not written to.
  MatValue value(Mat_VarCreate(name, kind, stored, static_cast<int>(sizes.size()), sizes.data(),
                               const_cast<void*>(data), 0));
  if (value == nullptr) throw std::bad_alloc();
  return value;
}

MatValue numbers(const char* name, std::vector<std::size_t> sizes,
                 const std::vector<double>& values) {
  return mat_value(name, MAT_C_DOUBLE, MAT_T_DOUBLE, std::move(sizes), values.data());
}

MatValue texts(const char* name, const std::vector<std::string>& texts) {
  MatValue cells = mat_value(name, MAT_C_CELL, MAT_T_CELL, {1, texts.size()}, nullptr);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    Mat_VarSetCell(
        cells.get(), static_cast<int>(i),
        mat_value(nullptr, MAT_C_CHAR, MAT_T_UINT8, {1, texts[i].size()}, texts[i].data())
            .release());
  }
  return cells;
}

/// matio does not tell of a write that has failed (a full disk): whether the file has the numbers.
bool has_numbers(mat_t* file, const char* name, const std::vector<double>& values) {
  const MatValue read(Mat_VarRead(file, name));
  return read != nullptr && read->data != nullptr &&
         read->nbytes == values.size() * sizeof(double) &&
         std::memcmp(read->data, values.data(), read->nbytes) == 0;
}

}  // namespace

void PckhTruth::write(const std::filesystem::path& file) const {
  const std::size_t joints = short_names_.size();
  const std::size_t persons = head_boxes_.size() / 4;
  AtomicFile output(file);
  bool is_whole = false;
  {
    // The header's text is given, since matio's own has the time.
    const MatFile mat(
        Mat_CreateVer(output.temporary().c_str(), "MATLAB 5.0 MAT-file, eventgan", MAT_FT_MAT5));
    const auto written = [&](const MatValue& value) {
      return Mat_VarWrite(mat.get(), value.get(), MAT_COMPRESSION_NONE) == 0;
    };
    is_whole = mat != nullptr && written(texts("dataset_joints", short_names_)) &&
               written(numbers("jnt_missing", {joints, persons}, missing_)) &&
               written(numbers("pos_gt_src", {joints, 2, persons}, positions_)) &&
               written(numbers("headboxes_src", {2, 2, persons}, head_boxes_));
  }
  if (is_whole) {
    const MatFile mat(Mat_Open(output.temporary().c_str(), MAT_ACC_RDONLY));
    is_whole = mat != nullptr && has_numbers(mat.get(), "jnt_missing", missing_) &&
               has_numbers(mat.get(), "pos_gt_src", positions_) &&
               has_numbers(mat.get(), "headboxes_src", head_boxes_);
  }
  if (!is_whole) {
    throw std::runtime_error("cannot write " + file.string() + unsaid_reason(output.temporary()));
  }
  output.publish();
}

}  // namespace eventgan
