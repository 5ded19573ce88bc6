#include "stages/frames/human36m/detail/extracted_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "stages/frames/human36m/derived_frame.h"
#include "stages/frames/human36m/detail/human36m_dataset.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

constexpr std::size_t kMostDigits = 9;

bool is_number(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

ExtractedName parse_extracted_name(std::string_view name) {
  const auto fail = [name] {
    throw std::invalid_argument(
        "expected an image below the root, named like S1_Directions_1.54138969_000001.jpg, got "
        "\"" +
        std::string(name) + "\"");
  };
  const std::filesystem::path path(name);
  if (path.is_absolute() || std::ranges::find(path, "..") != path.end()) fail();
  const std::string stem = path.stem().string();
  const std::size_t underscore = stem.rfind('_');
  const std::size_t dot = stem.rfind('.');
  const std::size_t subject_end = stem.find('_');
  if (underscore == std::string::npos || dot == std::string::npos || dot > underscore ||
      subject_end > dot || subject_end == 0) {
    fail();
  }
  ExtractedName result;
  result.sequence = stem.substr(0, underscore);
  result.subject = stem.substr(0, subject_end);
  result.camera = stem.substr(dot + 1, underscore - dot - 1);
  const std::string digits = stem.substr(underscore + 1);
  if (!is_number(result.camera) || !is_number(digits) || digits.size() > kMostDigits) fail();
  std::from_chars(digits.data(), digits.data() + digits.size(), result.number);
  result.folder = path.has_parent_path() ? path.parent_path().lexically_normal().generic_string()
                                         : result.subject + "/" + result.sequence;
  return result;
}

namespace {

constexpr char kMemberEnd[] = ".npy";
constexpr const char* kNeeded[] = {"imgname", "center", "scale", "part", "S"};

TypedArray read_array(const ZipArchive& archive, const std::string& name,
                      const std::string& shown) {
  return parse_npy(archive.read(name + kMemberEnd), shown + " (" + name + ")");
}

TableColumns read_npz_columns(const std::filesystem::path& file, const std::string& shown,
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
    : columns_(read_npz_columns(file, shown, notes_)), cameras_(std::move(cameras)) {
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
  if (!unknown.empty()) notes_.push_back(no_intrinsics_note(unknown));
  std::vector<double> errors_px;
  for (std::size_t row = 0; row < rows; ++row)
    errors_px.push_back(projection_error_px(person(row)));
  const std::string note = wrong_camera_note(errors_px, "cameras.pkl and S", shown);
  if (!note.empty()) notes_.push_back(note);
}

const Human36mCamera* NpzTable::camera(std::size_t row) const {
  return find_camera(cameras_, names_[row].subject, names_[row].camera);
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
  derive_box(person);
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

namespace {

/// The annotation file under both its names.
struct Annotations {
  std::string written;
  std::filesystem::path on_disk;
  std::vector<std::string> left_out = {};  ///< others beside it, each with the reason
};

Annotations choose_annotations(const SourceSpec& spec, const std::filesystem::path& base,
                               const SourceRoot& root) {
  if (spec.annotations) return {*spec.annotations, base / *spec.annotations};
  std::vector<std::string> candidates, fitting, left_out;
  for (const std::string& name : root.files_in("")) {
    if (!name.ends_with(".npz")) continue;
    const std::string reason = why_no_human36m_npz(root.on_disk(name));
    if (reason.empty()) fitting.push_back(name);
    const std::string shown = reason.empty() ? name : name + " (not usable: " + reason + ")";
    candidates.push_back(shown);
    if (!reason.empty()) left_out.push_back(shown);
  }
  if (fitting.size() == 1) {
    return {root.written(fitting[0]), root.on_disk(fitting[0]), std::move(left_out)};
  }
  const std::string message =
      "expected one .npz with imgname, center, scale, part [N, 17, 3] and S [N, 17, 4], got " +
      std::to_string(fitting.size()) + ", in " + root.written("") +
      ": name one under \"annotations\"" +
      (candidates.empty() ? "" : fmt::format("; there is {}", fmt::join(candidates, ", ")));
  if (fitting.empty()) throw InputError(message);  // absent or damaged
  throw UsageError(message);
}

/// A video by the names of its labelled images.
struct Video {
  std::string folder;
  std::vector<std::int64_t> labelled;
};

std::map<std::string, Video> videos_of(const NpzTable& table, const std::string& file) {
  std::map<std::string, Video> videos;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    const ExtractedName& name = table.name(row);
    Video& video = videos.try_emplace(name.sequence, Video{name.folder, {}}).first->second;
    if (video.folder != name.folder) {
      throw InputError("expected the images of " + name.sequence + " in one folder, got " +
                       video.folder + " and " + name.folder + ", in " + file);
    }
    video.labelled.push_back(name.number);
  }
  return videos;
}

/// Stored frames by sequence, from one listing of a folder, which may hold several sequences. An
/// image that is no frame, and the lesser of two of one frame, is noted.
std::map<std::string, NumberedSequence> stored_in(const SourceRoot& root, const std::string& folder,
                                                  IndexedDataset& dataset) {
  std::map<std::string, std::map<std::int64_t, std::string>> names;
  std::vector<std::string> left_out;
  for (const std::string& file : root.files_in(folder)) {
    std::string lower = file;
    std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
    const auto ends_file = [&](std::string_view extension) { return lower.ends_with(extension); };
    if (std::ranges::none_of(kImageExtensions, ends_file)) continue;
    const bool may_be_frame = file.ends_with(".jpg") || file.ends_with(".png");
    try {
      const ExtractedName name = parse_extracted_name(file);
      // Files come sorted, so a frame that is there as .jpg and .png counts once, as .jpg.
      if (may_be_frame && names[name.sequence].try_emplace(name.number, file).second) continue;
    } catch (const std::invalid_argument&) {  // another image, a segmentation perhaps
    }
    left_out.push_back(file);
  }
  if (!left_out.empty()) {
    dataset.add_note(counted(left_out, "image", " left out in " + root.written(folder)));
  }
  std::map<std::string, NumberedSequence> sequences;
  for (const auto& [sequence, files] : names) {
    sequences.emplace(sequence, NumberedSequence({files.begin(), files.end()}));
  }
  return sequences;
}

void add_videos(const SourceRoot& root, const std::map<std::string, Video>& videos,
                IndexedDataset& dataset) {
  std::map<std::string, std::vector<std::string>> sequences_by_folder;
  for (const auto& [sequence, video] : videos) {
    sequences_by_folder[video.folder].push_back(sequence);
  }
  for (const auto& [folder, sequences] : sequences_by_folder) {
    auto stored = stored_in(root, folder, dataset);
    for (const std::string& sequence : sequences) {
      dataset.add_take(sequence, std::make_unique<FrameFolder>(root.written(folder), sequence + "_",
                                                               std::move(stored[sequence]),
                                                               videos.at(sequence).labelled));
    }
  }
  std::vector<std::string> without_labels;
  for (const std::string& subject : root.folders_in("")) {
    if (!subject.starts_with('S')) continue;
    for (const std::string& sequence : root.folders_in(subject)) {
      const std::string folder = subject + "/" + sequence;
      if (!sequences_by_folder.contains(folder)) without_labels.push_back(root.written(folder));
    }
  }
  if (!without_labels.empty()) {
    dataset.add_note(count_text(std::ssize(without_labels), "folder",
                                " of images without labels, the first " + without_labels.front()));
  }
}

}  // namespace

std::unique_ptr<Dataset> open_human36m_extracted(const SourceSpec& spec,
                                                 const std::filesystem::path& base) {
  const SourceRoot root(spec.root, base);
  root.require_folder("");
  const Annotations annotations = choose_annotations(spec, base, root);
  auto dataset = std::make_unique<IndexedDataset>();
  if (!annotations.left_out.empty()) {  // one that is damaged may be the one that was meant
    dataset->add_note(counted(annotations.left_out, "annotation file",
                              " left out beside " + annotations.written));
  }

  auto table = std::make_unique<NpzTable>(annotations.on_disk, annotations.written,
                                          dataset->add_cameras(root));
  add_videos(root, videos_of(*table, annotations.written), *dataset);

  const std::string key = annotations.on_disk.filename().string();
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const ExtractedName& name = table->name(row);
    dataset->add_labelled(fmt::format("{}_{:06}", name.sequence, name.number), name.sequence,
                          name.number, key, row);
  }
  dataset->add_table(key, annotations.written, std::move(table));
  dataset->finish(root.written(""));
  return dataset;
}

}  // namespace eventgan
