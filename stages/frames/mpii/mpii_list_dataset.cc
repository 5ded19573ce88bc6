#include "stages/frames/mpii/mpii_list_dataset.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <unordered_map>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/base/archives/array_json.h"
#include "stages/base/archives/hdf5_arrays.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/mpii/detail/mpii_annotations.h"
#include "stages/frames/mpii/detail/mpii_list_dataset.h"
#include "stages/frames/mpii/mpii_frames.h"

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

int parse_listed_visible(const Json& value, const std::string& where) {
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
    const std::string place = '[' + std::to_string(i) + ']';
    Joint& joint = person.joints[i];
    joint.at = parse_point(joints[i], missing_joint, joints_name + place);
    const int seen =
        visible == nullptr ? -1 : parse_listed_visible((*visible)[i], visible_name + place);
    joint.visible = joint.at == kMissingPoint ? 0 : seen;
  }
  return person;
}

namespace {

/// A name given as an array of characters or of character codes, padded with zeros, as text.
Json joined(Json name) {
  if (!name.is_array()) return name;
  std::string text;
  for (const Json& part : name) {
    if (part.is_string()) text += part.get<std::string>();
    if (part.is_number() && part.get<double>() > 0 && part.get<double>() < 256) {
      text += static_cast<char>(static_cast<unsigned char>(part.get<double>()));
    }
  }
  return text;
}

Hdf5Arrays read_columns(const std::filesystem::path& file) try {
  return read_hdf5_arrays(file);
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

}  // namespace

MpiiList read_mpii_table(const std::filesystem::path& file) {
  const Hdf5Arrays content = read_columns(file);
  const std::string image = image_field(MpiiListForm::kTable);
  const auto images = content.arrays.find(image);
  if (images == content.arrays.end() || images->second.size() == 0 ||
      images->second.shape.empty()) {
    const auto unread = content.unread.find(image);
    throw InputError("expected a column " + image + ", got " +
                     (unread == content.unread.end() ? "none" : unread->second) + ", in " +
                     file.string());
  }
  const std::size_t count = images->second.shape[0];
  MpiiList list{MpiiListForm::kTable, std::vector<Json>(count, Json::object()), {}};
  const auto note = [&](const std::string& name, const std::string& got) {
    list.notes.push_back("column " + name + " left out (expected " + std::to_string(count) +
                         " rows of numbers or text, got " + got + "), in " + file.string());
  };
  for (const auto& [name, column] : content.arrays) {
    if (column.shape.empty() || column.shape[0] != count) {
      note(name, column.shape_text());
      continue;
    }
    for (std::size_t i = 0; i < count; ++i) {
      Json value = to_json(column, i);
      list.rows[i][name] = name == image ? joined(std::move(value)) : std::move(value);
    }
  }
  for (const auto& [name, reason] : content.unread) note(name, reason);
  return list;
}

namespace {

MpiiList read_json_list(const std::string& text, const std::filesystem::path& file) {
  Json rows;
  try {
    rows = parse_json_data(text, file.filename().string());
  } catch (const std::runtime_error& error) {
    throw InputError("expected a JSON list of people or an HDF5 table, got \"" +
                     std::string(error.what()) + "\", in " + file.string());
  }
  if (!rows.is_array()) {
    throw InputError(std::string("expected a JSON list of people, got one ") + rows.type_name() +
                     ", in " + file.string());
  }
  return {MpiiListForm::kJsonList, rows.get<std::vector<Json>>(), {}};
}

}  // namespace

MpiiList read_mpii_list(const std::filesystem::path& file) {
  constexpr std::string_view kHdf5 = "\x89HDF\r\n\x1a\n";
  std::string reason = "an empty file";
  const auto bytes = try_read_file(file, reason);
  if (!bytes || bytes->empty()) {
    throw InputError("expected a JSON list or an HDF5 table, got nothing readable (" + reason +
                     "), in " + file.string());
  }
  MpiiList list = bytes->starts_with(kHdf5) ? read_mpii_table(file) : read_json_list(*bytes, file);
  const char* const name = image_field(list.form);
  for (std::size_t i = 0; i < list.rows.size(); ++i) {
    const Json& row = list.rows[i];
    if (!row.is_object() || !row.contains(name) || !row[name].is_string() || row[name] == "") {
      throw InputError(std::string("expected an image's name under \"") + name +
                       "\", got none, in " + file.string() + " (row " + std::to_string(i) + ")");
    }
  }
  return list;
}

namespace {

namespace fs = std::filesystem;

/// Which frame of its video each image is, if a file tells: image name without extension to
/// keyframe.
class Keyframes {
 public:
  Keyframes(const SourceSpec& spec, const fs::path& base) {
    if (!spec.sequences) return;
    const fs::path sequences(*spec.sequences);
    file_ = find_mpii_keyframes(
        {fs::path(*spec.annotations).parent_path().generic_string(), sequences.generic_string(),
         sequences.parent_path().generic_string(), spec.root},
        base);
    if (file_.empty()) return;
    for (std::string& name : read_mpii_keyframes(base / file_)) {
      by_image_.try_emplace(name.substr(0, name.find('/')), std::move(name));
    }
  }

  const std::string& file() const { return file_; }

  std::string of(const std::string& image, const MpiiFrames& frames) const {
    if (file_.empty()) return frames.find_keyframe(image);
    const auto found = by_image_.find(without_extension(image));
    return found != by_image_.end() ? found->second : std::string();
  }

 private:
  std::string file_;
  std::unordered_map<std::string, std::string> by_image_;
};

class MpiiListDataset final : public Dataset {
 public:
  MpiiListDataset(const SourceSpec& spec, const fs::path& base)
      : file_(*spec.annotations),
        frames_(base, {(fs::path(spec.root) / "images").generic_string(), spec.root},
                spec.sequences ? std::vector{*spec.sequences} : std::vector<std::string>()) {
    const Keyframes keyframes(spec, base);
    keyframes_file_ = keyframes.file();
    MpiiList list = read_mpii_list(base / file_);
    form_ = list.form;
    notes_ = std::move(list.notes);

    std::map<std::string, Json> rows_by_image;
    for (Json& row : list.rows) {
      const auto image = row[image_field(form_)].get<std::string>();
      rows_by_image.try_emplace(image, Json::array()).first->second.push_back(std::move(row));
    }
    std::size_t alone = 0, unsized = 0;
    for (const auto& [image, rows] : rows_by_image) {
      labelled_.push_back(frames_.labelled(image, keyframes.of(image, frames_)));
      labelled_.back().label_key = image;
      rows_.emplace(image, Rows{dump_json(rows), labelled_.back().frame.path});
      if (frames_.is_without_image(labelled_.back(), image)) ++unsized;
      if (spec.sequences && labelled_.back().sequence.empty()) ++alone;
    }
    sort_samples(labelled_, file_);
    if (alone > 0) {
      notes_.push_back(
          count_text(alone, "image", " whose frame is in no sequence, so without neighbours"));
    }
    if (unsized > 0) notes_.push_back(count_text(unsized, "labelled frame", kWithoutImage));
  }

  const LabelSchema& label_schema() const override { return mpii_label_schema(); }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override {
    return frames_.paired_frame(frame, steps);
  }
  std::vector<std::string> notes() const override { return notes_; }

  std::vector<std::string> annotation_files() const override {
    std::vector<std::string> files = {file_};
    if (!keyframes_file_.empty()) files.push_back(keyframes_file_);
    std::ranges::sort(files);
    return files;
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    const auto rows = rows_.find(label_key);
    if (rows == rows_.end()) {
      return SampleFault{"expected people in an image, got none under " + label_key + ", in " +
                         file_};
    }
    Annotation annotation{rows->second.json, {}, {}};
    const auto scale = frames_.label_scale(label_key, rows->second.frame);
    if (is_fault(scale)) {
      return SampleFault{scale.fault().reason + " (sample " + without_extension(label_key) + ")"};
    }
    try {
      for (const Json& row : Json::parse(rows->second.json)) {
        annotation.persons.push_back(parse_mpii_list_row(row, form_));
      }
    } catch (const std::invalid_argument& error) {
      return SampleFault{std::string(error.what()) + " of its person " +
                         std::to_string(annotation.persons.size()) + ", in " +
                         label_place(label_key) + " (sample " + without_extension(label_key) + ")"};
    }
    scale_labels(*scale, annotation.persons);
    return annotation;
  }

  std::string label_place(const std::string& label_key) const override {
    return file_ + ":" + label_key;
  }

 private:
  struct Rows {
    std::string json;   ///< a list
    std::string frame;  ///< path of the labelled frame
  };

  std::string file_;
  std::string keyframes_file_;
  MpiiFrames frames_;
  MpiiListForm form_ = MpiiListForm::kJsonList;
  std::unordered_map<std::string, Rows> rows_;  ///< by image
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_mpii_list_dataset(const SourceSpec& spec, const fs::path& base) {
  if (!spec.annotations) throw UsageError("expected the key annotations for mpii_list, got none");
  SourceRoot(spec.root, base).require_folder("");
  if (spec.sequences) SourceRoot(*spec.sequences, base).require_folder("");
  return std::make_unique<MpiiListDataset>(spec, base);
}

namespace {

/// Whether it is a list of people: captions, CreateML's boxes and results are lists of images, too.
bool has_people(const MpiiList& list) {
  return std::ranges::any_of(list.rows, [&](const Json& row) {
    return row.contains("center") || row.contains("part") ||
           (row.contains("joints") && row["joints"].is_array());
  });
}

}  // namespace

std::vector<fs::path> find_mpii_lists(const fs::path& root) {
  // Somebody's folder of labels, shards or recordings is not to be read for a look at it.
  constexpr std::size_t kMostFiles = 20;
  constexpr std::uintmax_t kLargestBytes = std::uintmax_t{64} << 20;
  std::vector<fs::path> lists;
  for (const fs::path& folder : {root, root / "annot"}) {
    std::vector<std::string> files = list_folder(folder).files;
    std::erase_if(files, [&](const fs::path& name) {
      std::error_code unknown;
      return (name.extension() != ".json" && name.extension() != ".h5") ||
             fs::file_size(folder / name, unknown) > kLargestBytes;
    });
    if (files.size() > kMostFiles) continue;
    for (const std::string& name : files) {
      try {
        if (has_people(read_mpii_list(folder / name))) lists.push_back(folder / name);
      } catch (const InputError&) {  // another file
      }
    }
  }
  return lists;
}

namespace {

bool is_mpii_list(const fs::path& root) try {
  return has_folder(root) && !find_mpii_lists(root).empty();
} catch (const InputError&) {  // cannot be listed
  return false;
}

std::vector<FoundSource> complete_mpii_list(FoundSource found) {
  std::vector<fs::path> lists = find_mpii_lists(found.root);
  const auto train = std::ranges::find(lists, "train", [](const fs::path& l) { return l.stem(); });
  const auto chosen = train == lists.end() ? lists.begin() : train;
  found.annotations = *chosen;
  lists.erase(chosen);
  for (const fs::path& other : lists) {
    found.remarks.push_back("another list of people, left out: " +
                            other.lexically_relative(found.root).string());
  }
  for (const fs::path& above : {found.root, found.root.parent_path()}) {
    if (!found.sequences && has_folder(above / "sequences")) found.sequences = above / "sequences";
  }
  if (!found.sequences) {
    found.remarks.push_back(
        "no sequences (MPII's video frames; set \"sequences\" to their folder): no pairs");
  }
  return {std::move(found)};
}

constexpr std::array kMpiiListLayouts{DatasetLayout{
    .fits = is_mpii_list, .complete = complete_mpii_list, .may_be_part = [](std::string_view name) {
      return name.starts_with("image") || name == "sequences";
    }}};

}  // namespace

constinit const DatasetReader kMpiiListReader{.kind = DatasetKind::kMpiiList,
                                              .open = open_mpii_list_dataset,
                                              .layouts = kMpiiListLayouts,
                                              .habits = kMpiiHabits};

}  // namespace eventgan
