#include <cmath>
#include <set>
#include <utility>

#include "stages/archives/hdf5_arrays.h"
#include "stages/archives/typed_array_json_internal.h"
#include "stages/frames/human36m/fetch_table_internal.h"

namespace eventgan {
namespace {

constexpr char kIntrinsics[] = "intrinsics/";

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
  columns_.need("pose/3d-univ", {row_count_, joint_count_, 3});
  columns_.need("camera", {row_count_});
  columns_.need("frame", {row_count_});
  std::set<std::string> without_intrinsics;
  for (std::size_t row = 0; row < row_count_; ++row) {
    frame(row);
    if (!intrinsics(row)) without_intrinsics.insert(std::to_string(camera(row)));
  }
  for (const std::string& one : without_intrinsics) {
    notes_.push_back("no intrinsics for camera " + one + ", in " + shown);
  }
}

std::optional<Intrinsics> FetchTable::intrinsics(std::size_t row) const {
  const std::string name = kIntrinsics + std::to_string(camera(row));
  if (!columns_.arrays().contains(name)) return std::nullopt;
  const TypedArray& values = columns_.need(name, {4});
  return Intrinsics{.focal_x = values.number(0),
                    .focal_y = values.number(2),
                    .centre_x = values.number(1),
                    .centre_y = values.number(3)};
}

Outcome<Annotation> FetchTable::annotation(std::size_t row) const {
  const auto joints = columns_.row_of("pose/2d", row);
  const auto joints3d = columns_.row_of("pose/3d-univ", row);
  if (auto fault = columns_.not_finite(joints, "pose/2d", row)) return *fault;
  if (auto fault = columns_.not_finite(joints3d, "pose/3d-univ", row)) return *fault;
  Person person;
  for (std::size_t j = 0; j < joint_count_; ++j) {
    person.joints.push_back({.at = {joints[2 * j], joints[2 * j + 1]}, .visible = -1});
    person.joints3d_mm.push_back({joints3d[3 * j], joints3d[3 * j + 1], joints3d[3 * j + 2]});
  }
  person.camera = intrinsics(row);

  auto original = columns_.fields(row, row_count_, kIntrinsics);
  if (person.camera) {
    const std::string name = kIntrinsics + std::to_string(camera(row));
    if (auto fault = columns_.not_finite({person.camera->focal_x, person.camera->focal_y,
                                          person.camera->centre_x, person.camera->centre_y},
                                         name, 0)) {
      return *fault;
    }
    original[name] = to_json(columns_.arrays().at(name));
  }
  Annotation annotation;
  annotation.original = original.dump();
  annotation.persons.push_back(std::move(person));
  return annotation;
}

}  // namespace eventgan
