#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/naming/file_per_image.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/label_readers.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {

std::optional<bool> is_yolo_text(std::string_view text) {
  for (const TextLine& line : split_lines(text)) {
    const std::vector<std::string_view> columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    if (columns.size() < 5) return false;
    for (std::size_t i = 1; i < columns.size(); ++i) {
      constexpr double kMost = 1.1, kVisible = 2;  // joints have their visibility among the shares
      const auto share = parse_number<double>(columns[i]);
      if (!share || *share < 1 - kMost || *share > (i < 5 ? kMost : kVisible)) return false;
    }
    const auto number = parse_number<double>(columns[0]);
    return number && *number >= 0 && *number == std::floor(*number);
  }
  return std::nullopt;
}

namespace {

/// Texts that tools put beside the labels: lists of images, names of classes.
bool is_other_text(std::string_view file) {
  constexpr std::array<std::string_view, 10> kOthers = {
      "classes.txt", "predefined_classes.txt", "labels.txt", "train.txt", "val.txt", "valid.txt",
      "test.txt",    "autosplit.txt",          "obj.txt",    "readme.txt"};
  const std::string name = in_small_letters(std::string(file));
  return name.starts_with("readme.") || std::ranges::find(kOthers, name) != kOthers.end();
}

const LabelFiles kYoloFiles{".txt", {"images"}, {"labels", "obj_train_data"}, is_other_text};

class YoloLabels : public FilePerImage {
 public:
  YoloLabels(const LabelSpec& spec, const std::filesystem::path& base, LabelledSource labelled)
      : FilePerImage(spec, base, std::move(labelled), kYoloFiles) {
    read_classes();
    if (!classes_.has_shape) refuse_doubt();
    for (std::size_t i = 0; i < schema_.class_names.size(); ++i) {
      meanings_["class " + std::to_string(i)] = schema_.class_names[i];
    }
    std::ranges::sort(annotation_files_);
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    Outcome<std::string> text = root().read(label_key);
    if (is_fault(text)) return text.fault();
    Outcome<ImageSize> size = image_size(label_key);
    if (is_fault(size)) return size.fault();
    return parse_yolo_text(*std::move(text), classes_, *size, label_place(label_key));
  }

 private:
  void read_classes() {
    for (const SourceRoot& place : {root(), root().above()}) {
      const std::string name = yolo_names_file(place.on_disk(""));
      if (name.empty()) continue;
      const std::string path = place.written(name);
      classes_ = parse_yolo_names(place.read_or_throw(name), path);
      schema_ = classes_.names;
      annotation_files_.push_back(path);
      if (classes_.are_joints_assumed) {
        notes_.push_back("17 joints have COCO's names, since kpt_names names none, in " + path);
      }
      return warn_of_other_names(path);
    }
    number_classes();
  }

  /// Tools write their own list beside the labels: where two differ, only one is right.
  void warn_of_other_names(const std::string& taken) {
    std::set<std::string> folders = {""};
    for (const FrameLabel& label : labels()) {
      std::filesystem::path folder = label.key;
      do folder = folder.parent_path();
      while (!folder.empty() && folders.insert(folder.generic_string()).second);
    }
    for (const std::string& folder : folders) {
      for (const std::string& name : yolo_names_files(root().on_disk(folder))) {
        compare_names(taken, root(), folder.empty() ? name : folder + "/" + name);
      }
    }
    const SourceRoot above = root().above();
    for (const char* name : {"data.yaml", "data.yml", "classes.txt"}) {
      if (above.has_file(name)) compare_names(taken, above, name);
    }
  }

  void compare_names(const std::string& taken, const SourceRoot& place,
                     const std::string& name) try {
    const std::string path = place.written(name);
    if (path == taken) return;
    const YoloSchema other = parse_yolo_names(place.read_or_throw(name), path);
    const std::vector<std::string>& ours = schema_.class_names;
    const auto [our, their] = std::ranges::mismatch(ours, other.names.class_names);
    if (our == ours.end() || their == other.names.class_names.end()) return;
    warnings_.push_back(
        fmt::format("class {} is \"{}\" in {}, whose names are taken, but \"{}\" in {}",
                    our - ours.begin(), *our, taken, *their, path));
  } catch (const InputError&) {
    // Names that cannot be read, and that nobody needs, say nothing.
  }

  /// Without names these are the numbers, up to the highest that a text has.
  void number_classes() {
    int highest = -1;
    for (const FrameLabel& label : labels()) {
      const Outcome<std::string> text =
          label.key.empty() ? Outcome<std::string>(std::string()) : root().read(label.key);
      if (is_fault(text)) continue;  // a fault of its sample
      highest = std::max(highest, highest_yolo_class(*text));
    }
    if (highest < 0) {
      throw InputError(
          "expected data.yaml or classes.txt with the classes' names, or boxes, got "
          "neither, in " +
          root().written("") + " and the folder above it");
    }
    classes_ = numbered_yolo_classes(highest);
    schema_ = classes_.names;
    notes_.push_back("classes are named by their numbers, 0.." + std::to_string(highest) +
                     ", since no data.yaml or classes.txt with names is in " + root().written("") +
                     " or the folder above it");
  }

  /// Joints read as corners would be wrong, and nobody would find out.
  void refuse_doubt() const {
    PoseEvidence evidence;
    for (const FrameLabel& label : labels()) {
      if (label.key.empty()) continue;
      const Outcome<std::string> text = root().read(label.key);
      if (!is_fault(text)) evidence.add(*text);
      if (evidence.is_enough()) break;
    }
    const std::string doubt = evidence.doubt();
    if (doubt.empty()) return;
    throw InputError("expected " + doubt + ", got no kpt_shape in a data.yaml, in " +
                     root().written("") + " and the folder above it");
  }

  YoloSchema classes_;
};

/// Whether some of the texts in a folder, or in folders of it, are YOLO's.
bool has_yolo_texts(const std::filesystem::path& labels) {
  constexpr std::size_t kMost = 20;  // texts of images without objects say nothing
  std::vector<std::filesystem::path> texts;
  const auto add = [&](const std::filesystem::path& folder) {
    for (const auto& name : names_with(look_into(folder), ".txt")) {
      if (texts.size() == kMost) return;
      if (!is_other_text(name.string())) texts.push_back(folder / name);
    }
  };
  add(labels);
  for (const std::string& folder : look_into(labels).folders) {
    if (texts.size() == kMost) break;
    add(labels / folder);
  }
  return std::ranges::any_of(texts, [](const std::filesystem::path& text) {
    return is_yolo_text(beginning_of(text)).value_or(false);
  });
}

LabelSearch find_yolo(const FoundFrames& frames) {
  const std::filesystem::path labels = find_label_files(frames, kYoloFiles);
  if (labels.empty()) return {};
  const bool is_beside = labels == frames.root;  // of texts there, folders above have none
  std::filesystem::path folder = labels, named;
  // Above the dataset a YAML file may be another's, unless the folder below is called train.
  bool is_above = false, is_of_split = false;
  for (int level = 0; level < (is_beside ? 2 : 3); ++level, folder = folder.parent_path()) {
    const std::string file = yolo_names_file(folder);
    const bool is_yaml = lower_extension(file).starts_with(".y");
    const bool is_better =  // than a text below
        is_yaml && has_yolo_names(folder / file) && (!is_above || is_of_split);
    if (!file.empty() && (named.empty() || is_better)) named = folder;
    if (is_yaml && named == folder) break;
    if (is_above || *frames.root.lexically_relative(folder).begin() == "..") continue;
    is_above = true;
    is_of_split = !split_of(folder.filename().string()).empty();
  }
  if (!named.empty()) return {{is_beside ? labels : named}};
  if (has_yolo_texts(labels)) return {{labels}};  // which tell that their classes are numbers
  if (is_beside) return {};
  return {.remarks = {"no data.yaml or classes.txt, so that YOLO's labels are left out: " +
                      labels.string()}};
}

}  // namespace

constinit const LabelReader kYoloReader{LabelFormat::kYolo, open_labels<YoloLabels>, find_yolo,
                                        /*image_folder=*/{}, /*extension=*/".txt"};

}  // namespace eventgan
