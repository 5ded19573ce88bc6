#include <array>
#include <set>
#include <utility>

#include "manifests/strict_json/json_text_internal.h"
#include "stages/archives/hdf5_arrays.h"
#include "stages/archives/typed_array_json_internal.h"
#include "stages/frames/human36m/camera_book_internal.h"
#include "stages/frames/human36m/fetch_table_internal.h"

namespace eventgan {
namespace {

// h36m-fetch fits one camera to the subject's own joints and one to those of a skeleton of
// universal size. Its first versions had the latter only, under the former's name.
constexpr char kPose[] = "pose/3d";
constexpr char kCameras[] = "intrinsics/";
constexpr char kUniversalPose[] = "pose/3d-univ";
constexpr char kUniversalCameras[] = "intrinsics-univ/";

bool has_any(const TableColumns& columns, const std::string& prefix) {
  const auto found = columns.arrays().lower_bound(prefix);
  return found != columns.arrays().end() && found->first.starts_with(prefix);
}

TableColumns read_columns(const std::filesystem::path& file, const std::string& shown,
                          std::vector<std::string>& notes) {
  try {
    Hdf5Arrays content = read_hdf5_arrays(file);
    for (const auto& [name, reason] : content.unread) {
      notes.push_back("dataset " + name + " is left out of the labels (" + reason + "), in " +
                      shown);
    }
    return TableColumns(std::move(content.arrays), shown);
  } catch (const std::runtime_error& error) {
    throw InputError(error.what());
  }
}

}  // namespace

FetchTable::FetchTable(const std::filesystem::path& file, const std::string& shown)
    : columns_(read_columns(file, shown, notes_)) {
  const auto any = std::nullopt;
  const TypedArray& joints = columns_.need("pose/2d", {any, any, 2});
  row_count_ = joints.shape[0];
  joint_count_ = joints.shape[1];
  const bool has_pose = columns_.arrays().contains(kPose);
  const bool has_universal =
      columns_.arrays().contains(kUniversalPose) && has_any(columns_, kUniversalCameras);
  const bool takes_pose = has_pose && (has_any(columns_, kCameras) || !has_universal);
  pose_3d_ = takes_pose ? kPose : kUniversalPose;
  cameras_ = !takes_pose && has_universal ? kUniversalCameras : kCameras;
  columns_.need(pose_3d_, {row_count_, joint_count_, 3});
  columns_.need("camera", {row_count_});
  columns_.need("frame", {row_count_});
  std::set<std::string> without_intrinsics;
  std::vector<double> errors_px;
  for (std::size_t row = 0; row < row_count_; ++row) {
    frame(row);
    errors_px.push_back(projection_error_px(person(row)));
    if (!intrinsics(row)) without_intrinsics.insert(std::to_string(camera(row)));
  }
  for (const std::string& one : without_intrinsics) {
    notes_.push_back("no intrinsics for camera " + one + ", in " + shown);
  }
  const std::string note = wrong_camera_note(errors_px, cameras_ + "CAMERA and " + pose_3d_, shown);
  if (!note.empty()) notes_.push_back(note);
}

std::optional<Intrinsics> FetchTable::intrinsics(std::size_t row) const {
  const std::string name = cameras_ + std::to_string(camera(row));
  if (!columns_.arrays().contains(name)) return std::nullopt;
  const TypedArray& values = columns_.need(name, {4});
  return Intrinsics{.focal_x = values.number(0),
                    .focal_y = values.number(2),
                    .centre_x = values.number(1),
                    .centre_y = values.number(3)};
}

Person FetchTable::person(std::size_t row) const {
  const auto joints = columns_.row_of("pose/2d", row);
  const auto joints3d = columns_.row_of(pose_3d_, row);
  Person person;
  for (std::size_t j = 0; j < joint_count_; ++j) {
    person.joints.push_back({.at = {joints[2 * j], joints[2 * j + 1]}, .visible = -1});
    person.joints3d_mm.push_back(
        std::array{joints3d[3 * j], joints3d[3 * j + 1], joints3d[3 * j + 2]});
  }
  person.camera = intrinsics(row);
  return person;
}

Outcome<Annotation> FetchTable::annotation(std::size_t row) const {
  for (const std::string& name : {std::string("pose/2d"), pose_3d_}) {
    if (auto fault = columns_.not_finite(columns_.row_of(name, row), name, row)) return *fault;
  }
  Annotation annotation;
  Person& person = annotation.persons.emplace_back(this->person(row));
  if (person.camera) {
    if (auto fault = columns_.not_finite({person.camera->focal_x, person.camera->focal_y,
                                          person.camera->centre_x, person.camera->centre_y},
                                         cameras_ + std::to_string(camera(row)), 0)) {
      return *fault;
    }
  }
  take_wrong_camera(person);

  auto original = columns_.fields(row, row_count_, "intrinsics");
  for (const char* cameras : {kCameras, kUniversalCameras}) {
    const auto found = columns_.arrays().find(cameras + std::to_string(camera(row)));
    if (found != columns_.arrays().end()) original[found->first] = to_json(found->second);
  }
  // Names in the file may be in any encoding.
  annotation.original = dump_json(original);
  return annotation;
}

}  // namespace eventgan
