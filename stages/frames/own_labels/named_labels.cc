// The formats whose boxes tell their class by name: Pascal VOC, MOT, and tables.

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "manifests/documents/detail/json_text.h"
#include "stages/frames/own_labels/detail/csv_labels.h"
#include "stages/frames/own_labels/detail/file_per_image.h"
#include "stages/frames/own_labels/detail/frame_names.h"
#include "stages/frames/own_labels/detail/mot_labels.h"
#include "stages/frames/own_labels/detail/voc_labels.h"
#include "stages/frames/own_labels/own_labels.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The names of all classes, in the order of their names.
class ClassList {
 public:
  void add(const Outcome<ImageLabels>& labels) {
    if (is_fault(labels)) return;
    for (const NamedBox& box : std::get<ImageLabels>(labels).boxes) names_.insert(box.class_name);
  }
  std::vector<std::string> names() const { return {names_.begin(), names_.end()}; }

 private:
  std::set<std::string> names_;
};

/// The labels of an image of that size, with the classes' numbers.
Outcome<Annotation> numbered(ImageLabels labels, const std::vector<std::string>& class_names,
                             ImageSize image, const std::string& place) {
  Annotation annotation;
  annotation.original = std::move(labels.original);
  for (NamedBox& named : labels.boxes) {
    const auto name = std::ranges::lower_bound(class_names, named.class_name);
    if (name == class_names.end() || *name != named.class_name) {
      return SampleFault{"expected a class that was there when the labels were opened, got \"" +
                         escape_controls(named.class_name) + "\", in " + place};
    }
    named.box.class_id = static_cast<int>(name - class_names.begin());
    if (!overlaps(named.box.xyxy, image)) {
      return SampleFault{outside_text(named.box.xyxy, image) + ", in " + place};
    }
    annotation.boxes.push_back(named.box);
  }
  return annotation;
}

class VocLabels : public FilePerImage {
 public:
  VocLabels(const LabelSpec& spec, const fs::path& base, LabelledSource labelled)
      : FilePerImage(spec, base, std::move(labelled),
                     {".xml", {"JPEGImages", "images"}, "Annotations", ""}) {
    ClassList classes;
    for (const FrameLabel& label : labels()) {
      if (!label.key.empty()) classes.add(read(label.key));
    }
    schema_.class_names = classes.names();
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    Outcome<ImageLabels> labels = read(label_key);
    if (auto* fault = std::get_if<SampleFault>(&labels)) return std::move(*fault);
    auto& read = std::get<ImageLabels>(labels);
    Outcome<ImageSize> size = image_size(label_key, read.size);
    if (auto* fault = std::get_if<SampleFault>(&size)) return std::move(*fault);
    return numbered(std::move(read), schema_.class_names, std::get<ImageSize>(size),
                    label_place(label_key));
  }

 private:
  Outcome<ImageLabels> read(const std::string& label_key) const {
    Outcome<std::string> text = root().read(label_key);
    if (auto* fault = std::get_if<SampleFault>(&text)) return std::move(*fault);
    return parse_voc_labels(std::get<std::string>(std::move(text)), label_place(label_key));
  }
};

/// Labels that are in memory, by label_key.
class ReadLabels : public OwnLabels {
 public:
  Outcome<Annotation> annotation(const std::string& label_key) const override {
    const auto found = by_key_.find(label_key);
    if (found == by_key_.end()) {
      return SampleFault{"expected a label, got none, in " + label_place(label_key)};
    }
    if (const auto* fault = std::get_if<SampleFault>(&found->second)) return *fault;
    const ImageLabels& labels = std::get<ImageLabels>(found->second);
    Outcome<ImageSize> size = image_size(label_key, labels.size);
    if (auto* fault = std::get_if<SampleFault>(&size)) return std::move(*fault);
    return numbered(labels, schema_.class_names, std::get<ImageSize>(size), label_place(label_key));
  }

 protected:
  explicit ReadLabels(LabelledSource labelled) : OwnLabels(std::move(labelled)) {}

  std::map<std::string, Outcome<ImageLabels>> by_key_;
};

class CsvLabels : public ReadLabels {
 public:
  CsvLabels(const LabelSpec& spec, const fs::path& base, LabelledSource labelled)
      : ReadLabels(std::move(labelled)), path_(spec.path) {
    by_key_ = parse_csv_labels(SourceRoot("", base).read_or_throw(path_), path_);
    annotation_files_.push_back(path_);
    ClassList classes;
    const FrameNames names(source());
    std::vector<std::string> of_several;
    for (const auto& [image, labels] : by_key_) {
      classes.add(labels);
      const FrameNames::Match match = names.find(image);
      if (match.frame == FrameNames::kSeveral) {
        of_several.push_back(image);
      } else if (match.frame == FrameNames::kNone) {
        give_absent(match.below_root, image);
      } else {
        give(match.frame, image);
      }
    }
    refuse_bare_names(of_several, path_);
    schema_.class_names = classes.names();
    note_without_label(path_);
  }

  std::string label_place(const std::string& label_key) const override {
    return path_ + "#" + label_key;
  }

 private:
  std::string path_;
};

class MotLabels : public ReadLabels {
 public:
  MotLabels(const LabelSpec& spec, const fs::path& base, LabelledSource labelled)
      : ReadLabels(std::move(labelled)), root_(spec.path, base) {
    std::map<std::string, Frames> sequences;
    for (std::size_t i = 0; i < source().frames.size(); ++i) {
      const SourceFrame& frame = source().frames[i];
      sequences[frame.sequence].emplace(frame.number, i);
    }
    std::vector<std::string> without;
    const bool is_file = fs::is_regular_file(root_.on_disk(""));
    if (is_file && sequences.size() > 1) {
      throw InputError("expected a folder of sequences, since there are " +
                       std::to_string(sequences.size()) + ", got a file, in " + spec.path);
    }
    if (!is_file) root_.require_folder("");
    for (const auto& [sequence, frames] : sequences) {
      const std::optional<std::string> file = is_file ? "" : find_file(sequence);
      if (file) {
        read_sequence(sequence, *file, frames);
      } else {
        without.push_back(sequence);
      }
    }
    if (!without.empty()) {
      notes_.push_back(
          counted(without, "sequences without gt/gt.txt or gt.txt in " + root_.written("")));
    }
    std::vector<std::string> unused;
    for (const std::string& name : is_file ? std::vector<std::string>() : root_.folders_in("")) {
      const bool is_other = name != "gt" && !sequences.contains(name);
      if (is_other && find_file(name)) unused.push_back(name);
    }
    if (!unused.empty()) {
      notes_.push_back(
          counted(unused, "sequences of labels without images left out in " + root_.written("")));
    }
    schema_.class_names = classes_.names();
    std::ranges::sort(annotation_files_);
    note_without_label(root_.written(""));
  }

  std::string label_place(const std::string& label_key) const override {
    return label_key.starts_with('#') ? root_.written("") + label_key : root_.written(label_key);
  }

  std::optional<double> frames_per_second(const std::string& sequence) const override {
    const auto rate = rates_.find(sequence);
    return rate == rates_.end() ? std::nullopt : std::optional(rate->second);
  }

 private:
  using Frames = std::map<std::int64_t, std::size_t>;  ///< by FrameRef::index

  /// SEQUENCE/gt/gt.txt, SEQUENCE/gt.txt; of the only one gt/gt.txt and gt.txt too.
  std::optional<std::string> find_file(const std::string& sequence) const {
    const std::string folder = sequence.empty() ? "" : sequence + "/";
    for (const char* name : {"gt/gt.txt", "gt.txt"}) {
      if (root_.has_file(folder + name)) return folder + name;
    }
    return std::nullopt;
  }

  /// seqinfo.ini in the folder of gt.txt, or above it where that is named gt.
  std::optional<MotSequence> read_info(const std::string& file) {
    SourceRoot folder = root_.above(file);
    if (folder.name() == "gt") folder = folder.above();
    if (!folder.has_file("seqinfo.ini")) return std::nullopt;
    const std::string path = folder.written("seqinfo.ini");
    annotation_files_.push_back(path);
    return parse_mot_sequence(folder.read_or_throw("seqinfo.ini"), path);
  }

  /// Throws InputError if images whose names tell no number, and which are counted in their order
  /// for that, are not as many as the sequence: one that is missing would shift the labels of all
  /// behind it.
  void require_all(const Frames& frames, const std::optional<MotSequence>& info,
                   std::int64_t last_number, const std::string& path) const {
    const auto tells_number = [&](const auto& frame) {
      const std::string stem = fs::path(source().frames[frame.second].name).stem().string();
      std::string digits = stem.substr(stem.find_last_not_of("0123456789") + 1);
      digits.erase(0, std::min(digits.find_first_not_of('0'), digits.size() - 1));
      return digits == std::to_string(frame.first);
    };
    if (source().is_video || std::ranges::all_of(frames, tells_number)) return;
    const std::int64_t count = std::ssize(frames);
    if (info ? count == info->length : count >= last_number) return;
    const fs::path first(source().frames[frames.begin()->second].name);
    throw InputError(fmt::format(
        "expected numbered images, or all {} frames of {}, got {} without numbers, in {}",
        info ? info->length : last_number, path, count,
        source().root.written(first.parent_path().generic_string())));
  }

  void read_sequence(const std::string& sequence, const std::string& file, const Frames& frames) {
    const std::string path = root_.written(file);
    annotation_files_.push_back(path);
    const std::optional<MotSequence> info = read_info(file);
    if (info) rates_[sequence] = info->frames_per_second;
    // MOT's first frame is 1: that of a video is 0, and so may that of images be.
    const bool from_0 = source().is_video || frames.begin()->first == 0;
    if (from_0 && !source().is_video) {
      notes_.push_back("frame 1 of " + path + " is " +
                       source().root.written(source().frames[frames.begin()->second].name));
    }
    auto by_number = parse_mot_labels(root_.read_or_throw(file), path);
    if (from_0) require_all(frames, info, by_number.empty() ? 0 : by_number.rbegin()->first, path);
    for (auto& [number, labels] : by_number) {
      const std::string key = file + "#" + std::to_string(number);
      classes_.add(labels);
      if (info && !is_fault(labels)) std::get<ImageLabels>(labels).size = info->size;
      by_key_.emplace(key, std::move(labels));
      const auto frame = frames.find(from_0 ? number - 1 : number);
      if (frame != frames.end()) {
        give(frame->second, key);
      } else {
        const fs::path first(source().frames[frames.begin()->second].name);
        const std::string name =
            fmt::format("{:06}{}", from_0 ? number - 1 : number, first.extension().string());
        give_absent((first.parent_path() / name).generic_string(), key);
      }
    }
  }

  SourceRoot root_;
  ClassList classes_;
  std::map<std::string, double> rates_;
};

}  // namespace

std::unique_ptr<OwnLabels> open_voc_labels(const LabelSpec& spec, const fs::path& base,
                                           LabelledSource source) {
  return std::make_unique<VocLabels>(spec, base, std::move(source));
}

std::unique_ptr<OwnLabels> open_csv_labels(const LabelSpec& spec, const fs::path& base,
                                           LabelledSource source) {
  return std::make_unique<CsvLabels>(spec, base, std::move(source));
}

std::unique_ptr<OwnLabels> open_mot_labels(const LabelSpec& spec, const fs::path& base,
                                           LabelledSource source) {
  return std::make_unique<MotLabels>(spec, base, std::move(source));
}

}  // namespace eventgan
