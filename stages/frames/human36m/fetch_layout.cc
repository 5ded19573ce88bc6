#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/base/archives/array_json.h"
#include "stages/base/archives/hdf5_arrays.h"
#include "stages/frames/human36m/derived_frame.h"
#include "stages/frames/human36m/detail/camera_book.h"
#include "stages/frames/human36m/detail/human36m_dataset.h"
#include "stages/frames/human36m/detail/pose_table.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

/// An annot.h5 of h36m-fetch in memory; see human36m_dataset.h for its datasets.
class FetchTable final : public PoseTable {
 public:
  /// `shown` names the file in messages. Throws InputError. Uses HDF5, here only.
  FetchTable(const std::filesystem::path& file, const std::string& shown);

  std::size_t row_count() const override { return row_count_; }
  std::size_t joint_count() const override { return joint_count_; }
  Outcome<Annotation> annotation(std::size_t row) const override;
  std::vector<std::string> notes() const override { return notes_; }

  /// The camera's serial number and the frame's number in its video.
  std::int64_t camera(std::size_t row) const { return columns_.whole_number("camera", row); }
  std::int64_t frame(std::size_t row) const { return columns_.whole_number("frame", row); }

 private:
  std::optional<Intrinsics> intrinsics(std::size_t row) const;
  Person person(std::size_t row) const;

  std::vector<std::string> notes_;
  TableColumns columns_;
  // Joints in 3-D and the group of cameras that goes with them.
  std::string pose_3d_;
  std::string cameras_;
  std::size_t row_count_ = 0;
  std::size_t joint_count_ = 0;
};

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

TableColumns read_hdf5_columns(const std::filesystem::path& file, const std::string& shown,
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
    : columns_(read_hdf5_columns(file, shown, notes_)) {
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
  Person person = person_of_joints(columns_.row_of("pose/2d", row), columns_.row_of(pose_3d_, row));
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

namespace {

constexpr char kPrefix[] = "img_";

/// One ACTION-N folder, `action` below the root. Gives the folders of images that have no label.
std::vector<std::string> add_action(const SourceRoot& root, const std::string& action,
                                    IndexedDataset& dataset) {
  const std::string images = action + "/imageSequence";
  std::vector<std::string> cameras = root.folders_in(images);
  const auto files = root.files_in(action);
  const bool labelled = std::ranges::binary_search(files, "annot.h5");

  std::map<std::string, std::vector<std::int64_t>> numbers;  // by camera
  const std::string key = action + "/annot.h5";
  std::unique_ptr<FetchTable> table;
  if (labelled) {
    table = std::make_unique<FetchTable>(root.on_disk(key), root.written(key));
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      numbers[std::to_string(table->camera(row))].push_back(table->frame(row));
    }
  }
  for (const auto& [camera, labelled_numbers] : numbers) {
    const std::string folder = images + "/" + camera;
    auto stored = NumberedSequence::list(root.on_disk(folder), kPrefix);
    if (const auto& others = stored.left_out(); !others.empty()) {
      dataset.add_note(counted(others, "file", " left out in " + root.written(folder)));
    }
    dataset.add_take(action + "/" + camera,
                     std::make_unique<FrameFolder>(root.written(folder), kPrefix, std::move(stored),
                                                   labelled_numbers));
  }
  for (std::size_t row = 0; labelled && row < table->row_count(); ++row) {
    const std::string sequence = action + "/" + std::to_string(table->camera(row));
    const std::int64_t number = table->frame(row);
    dataset.add_labelled(fmt::format("{}/{:06}", sequence, number), sequence, number, key, row);
  }
  if (labelled) dataset.add_table(key, root.written(key), std::move(table));

  std::erase_if(cameras, [&](const std::string& camera) { return numbers.contains(camera); });
  for (std::string& camera : cameras) camera = root.written(images + "/" + camera);
  return cameras;
}

}  // namespace

std::unique_ptr<Dataset> open_human36m_fetch(const SourceSpec& spec,
                                             const std::filesystem::path& base) {
  const SourceRoot root(spec.root, base);
  root.require_folder("");
  auto dataset = std::make_unique<IndexedDataset>();
  std::vector<std::string> without_labels;
  for (const std::string& subject : root.folders_in("")) {
    if (!subject.starts_with('S')) continue;
    for (const std::string& action : root.folders_in(subject)) {
      const auto found = add_action(root, subject + "/" + action, *dataset);
      without_labels.insert(without_labels.end(), found.begin(), found.end());
    }
  }
  if (!without_labels.empty()) {
    dataset->add_note(count_text(std::ssize(without_labels), "folder",
                                 " of images without labels, the first " + without_labels.front()));
  }
  if (dataset->annotation_files().empty()) {
    throw InputError("expected SUBJECT/ACTION/annot.h5 files, got none, in " + root.written(""));
  }
  dataset->finish(root.written(""));
  return dataset;
}

}  // namespace eventgan
