#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "manifests/strict_json/json_text_internal.h"
#include "stages/archives/npy_array.h"
#include "stages/archives/zip_archive.h"
#include "stages/frames/human36m/npz_table_internal.h"

namespace eventgan {
namespace {

constexpr char kMemberEnd[] = ".npy";
constexpr const char* kNeeded[] = {"imgname", "center", "scale", "part", "S"};

TypedArray read_array(const ZipArchive& archive, const std::string& name,
                      const std::string& shown) {
  return parse_npy(archive.read(name + kMemberEnd), shown + " (" + name + ")");
}

TableColumns read_columns(const std::filesystem::path& file, const std::string& shown,
                          std::vector<std::string>& notes) try {
  const ZipArchive archive(file);
  std::map<std::string, TypedArray> arrays;
  for (const std::string& member : archive.names()) {
    if (!member.ends_with(kMemberEnd)) continue;
    const std::string name = member.substr(0, member.size() - std::string(kMemberEnd).size());
    const auto bytes = archive.read(member);
    try {
      arrays.emplace(name, parse_npy(bytes, shown + " (" + name + ")"));
    } catch (const std::runtime_error& error) {
      if (std::ranges::find(kNeeded, name) != std::end(kNeeded)) throw;
      notes.push_back("array " + name + " is left out of the labels: " + error.what());
    }
  }
  return TableColumns(std::move(arrays), shown);
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

}  // namespace

NpzTable::NpzTable(const std::filesystem::path& file, const std::string& shown, CameraBook cameras)
    : columns_(read_columns(file, shown, notes_)), cameras_(std::move(cameras)) {
  const auto any = std::nullopt;
  const TypedArray& images = columns_.need("imgname", {any}, /*text=*/true);
  const std::size_t rows = images.size();
  joint_count_ = columns_.need("part", {rows, any, 3}).shape[1];
  columns_.need("S", {rows, joint_count_, 4});
  columns_.need("center", {rows, 2});
  columns_.need("scale", {rows});
  std::set<std::string> unknown;
  for (std::size_t row = 0; row < rows; ++row) {
    try {
      names_.push_back(parse_extracted_name(images.text(row)));
    } catch (const std::invalid_argument& error) {
      throw InputError(std::string(error.what()) + ", in " + shown + " (imgname, row " +
                       std::to_string(row) + ")");
    }
    if (camera(row) == nullptr) unknown.insert(names_[row].subject + " " + names_[row].camera);
  }
  if (!unknown.empty()) {
    notes_.push_back("no intrinsics for " + std::to_string(unknown.size()) +
                     " cameras of subjects, the first " + *unknown.begin() +
                     ": not in a cameras.pkl in the root");
  }
  std::vector<double> errors_px;
  for (std::size_t row = 0; row < rows; ++row)
    errors_px.push_back(projection_error_px(person(row)));
  const std::string note = wrong_camera_note(errors_px, "cameras.pkl and S", shown);
  if (!note.empty()) notes_.push_back(note);
}

const Human36mCamera* NpzTable::camera(std::size_t row) const {
  const auto found = cameras_.find({names_[row].subject, names_[row].camera});
  return found == cameras_.end() ? nullptr : &found->second;
}

Person NpzTable::person(std::size_t row) const {
  const auto part = columns_.row_of("part", row);
  const auto joints3d = columns_.row_of("S", row);
  const auto center = columns_.row_of("center", row);
  Person person;
  bool any_in_3d = false;
  for (std::size_t j = 0; j < joint_count_; ++j) {
    // The third number is a confidence, 1 for whatever is annotated: it says nothing of visibility.
    const Point at{part[3 * j], part[3 * j + 1]};
    const bool sure = part[3 * j + 2] > 0;
    const bool annotated = sure || at != Point{0, 0};
    person.joints.push_back({.at = annotated ? at : kMissingPoint, .visible = sure ? -1 : 0});
    constexpr double kMmPerMetre = 1000;
    auto& place = person.joints3d_mm.emplace_back();
    if (!(joints3d[4 * j + 3] > 0)) continue;
    place = {kMmPerMetre * joints3d[4 * j], kMmPerMetre * joints3d[4 * j + 1],
             kMmPerMetre * joints3d[4 * j + 2]};
    any_in_3d = true;
  }
  if (!any_in_3d) person.joints3d_mm.clear();
  person.center = {center[0], center[1]};
  person.scale = columns_.row_of("scale", row)[0];
  if (const Human36mCamera* one = camera(row)) {
    person.camera = one->intrinsics;
    person.distortion = one->distortion;
  }
  return person;
}

Outcome<Annotation> NpzTable::annotation(std::size_t row) const {
  for (const char* name : {"part", "S", "center", "scale"}) {
    if (auto fault = columns_.not_finite(columns_.row_of(name, row), name, row)) return *fault;
  }
  Annotation annotation;
  take_wrong_camera(annotation.persons.emplace_back(person(row)));
  auto original = columns_.fields(row, row_count());
  if (const Human36mCamera* one = camera(row)) original["cameras.pkl"] = one->fields;
  // Text of a Python 2 pickle may be in any encoding.
  annotation.original = dump_json(original);
  return annotation;
}

std::string why_no_human36m_npz(const std::filesystem::path& file) try {
  const ZipArchive archive(file);
  for (const char* name : kNeeded) {
    if (!archive.contains(std::string(name) + kMemberEnd)) {
      return std::string("expected an array ") + name + ", got none";
    }
  }
  for (const auto& [name, width] :
       {std::pair("part", std::size_t{3}), std::pair("S", std::size_t{4})}) {
    const TypedArray array = read_array(archive, name, file.filename().string());
    if (array.shape.size() != 3 || array.shape[1] != 17 || array.shape[2] != width) {
      return std::string("expected ") + name + " of shape [N, 17, " + std::to_string(width) +
             "], got " + array.shape_text();
    }
  }
  return "";
} catch (const std::runtime_error& error) {
  return error.what();
}

}  // namespace eventgan
