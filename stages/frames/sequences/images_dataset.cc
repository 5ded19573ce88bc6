#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/own_labels/detail/absent_frames.h"
#include "stages/frames/own_labels/own_labels.h"
#include "stages/frames/sequences/frames_dataset.h"
#include "stages/frames/sequences/image_folder.h"
#include "stages/frames/source_folders.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A folder of images that is a sequence.
struct ListedSequence {
  std::string path;  ///< below ROOT
  ImageFolder images;
};

class ImagesDataset final : public Dataset {
 public:
  ImagesDataset(const SourceSpec& spec, const fs::path& base)
      : root_(spec.root, base), frames_per_second_(spec.frames_per_second) {
    ImageFolder top = list_image_folder(root_.on_disk(""));
    const auto note = [this](std::int64_t count, const char* noun, const std::string& rest) {
      if (count == 0) return;
      notes_.push_back(count_text(count, noun, rest + " in " + root_.written("")));
    };
    std::map<std::string, ListedSequence> listed;
    std::size_t without_images = 0;
    const bool is_flat = !top.frames.empty();
    const std::vector<std::string> folders = top.folders;
    if (is_flat) top.folders.clear();
    listed[""] = {"", std::move(top)};
    if (!is_flat) {
      for (const std::string& name : folders) {
        ListedSequence sequence = list_sequence(name, spec.labels);
        if (sequence.images.frames.empty()) ++without_images;
        listed.emplace(name, std::move(sequence));
      }
    }
    for (const auto& [sequence, folder] : listed) {
      sequences_.emplace(sequence, Sequence{folder.path, folder.images.frames});
    }
    const bool is_empty = std::ranges::all_of(
        sequences_, [](const auto& sequence) { return sequence.second.frames.empty(); });
    if (is_empty) {
      throw InputError("expected images, folders of images, or videos, got none, in " +
                       root_.on_disk("").string());
    }
    if (spec.labels) {
      add_labelled(*spec.labels, base);
      std::ranges::sort(annotation_files_);
    } else {
      for (const auto& [sequence, folder] : listed) add_all(sequence, folder.images);
    }
    note(is_flat ? std::ssize(folders) : 0, "folder", " beside the images left out");
    for (const auto& [sequence, folder] : listed) note_unused(sequence, folder);
    note(without_images, "folder", " without images");
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
  }

  const LabelSchema& label_schema() const override { return labels_ ? labels_->schema() : schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::vector<std::string> notes() const override { return notes_; }
  std::vector<std::string> warnings() const override {
    return labels_ ? labels_->warnings() : std::vector<std::string>();
  }

  PairedFrame paired_frame(const LabelledFrame& labelled, int steps) const override {
    if (labelled.frame.index == kAbsentFrame) return {PairedFrame::State::kMissing, labelled.frame};
    const auto sequence = sequences_.find(labelled.sequence);
    if (sequence == sequences_.end()) return {};
    const auto place = sequence->second.frames.at(labelled.frame.index, steps);
    if (place.state == PairedFrame::State::kBeyond) return {};
    return {place.state, frame(sequence->first, place.number, place.name)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    if (labels_) return labels_->annotation(label_key);
    if (lower_extension(label_key) != ".json") return Annotation{};
    Outcome<std::string> text = root_.read(label_key);
    if (is_fault(text)) return text.fault();
    Annotation annotation{*std::move(text), {}, {}};
    try {
      parse_json_data(annotation.original, label_place(label_key));
    } catch (const std::runtime_error& error) {
      return SampleFault{error.what()};
    }
    return annotation;
  }

  ImageSizes* image_sizes() const override { return labels_ ? labels_->image_sizes() : nullptr; }

  std::string label_place(const std::string& label_key) const override {
    return labels_ ? labels_->label_place(label_key) : root_.written(label_key);
  }

 private:
  struct Sequence {
    std::string path;  ///< below ROOT
    NumberedSequence frames;
  };

  static std::string spelled(const fs::path& path) { return path.generic_string(); }

  /// The folder NAME, or NAME/img1 of a sequence as MOT has them (LabelReader::image_folder).
  ListedSequence list_sequence(const std::string& name,
                               const std::optional<LabelSpec>& labels) const {
    ListedSequence listed{name, list_image_folder(root_.on_disk(name))};
    const std::string_view images = labels ? label_reader(labels->format).image_folder : "";
    const auto& folders = listed.images.folders;
    const bool is_below =
        listed.images.frames.empty() && std::ranges::find(folders, images) != folders.end();
    if (!is_below) return listed;
    const std::string below = name + "/" + std::string(images);
    return {below, list_image_folder(root_.on_disk(below))};
  }

  FrameRef frame(const std::string& sequence, std::int64_t number, const std::string& name) const {
    const std::string below = spelled(fs::path(sequences_.at(sequence).path) / name);
    FrameRef frame{root_.written(below), number};
    const auto rate =
        frames_per_second_ || !labels_ ? frames_per_second_ : labels_->frames_per_second(sequence);
    if (rate) frame.time_s = static_cast<double>(number) / *rate;
    return frame;
  }

  /// Without labels of a known form every frame is a sample.
  void add_all(const std::string& sequence, const ImageFolder& folder) {
    for (const auto& [number, name] : folder.frames.frames()) {
      const fs::path below = fs::path(sequence) / name;
      LabelledFrame labelled;
      labelled.sample_id = spelled(below.parent_path() / below.stem());
      labelled.sequence = sequence;
      labelled.frame = frame(sequence, number, name);
      const auto sidecar = folder.sidecars.find(below.stem().string());
      const bool has_label = sidecar != folder.sidecars.end();
      labelled.label_key = spelled(has_label ? fs::path(sequence) / sidecar->second : below);
      if (has_label) annotation_files_.push_back(root_.written(labelled.label_key));
      labelled_.push_back(std::move(labelled));
    }
  }

  void add_labelled(const LabelSpec& spec, const fs::path& base) {
    LabelledSource source{root_, {}, /*is_video=*/false};
    for (const auto& [sequence, listed] : sequences_) {
      for (const auto& [number, name] : listed.frames.frames()) {
        source.frames.push_back(
            {spelled(fs::path(listed.path) / name), sequence, number, std::nullopt});
      }
    }
    labels_ = open_own_labels(spec, base, std::move(source));
    const std::vector<SourceFrame>& frames = labels_->source().frames;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const FrameLabel& label = labels_->labels()[i];
      if (label.key.empty()) continue;
      const fs::path name = fs::path(frames[i].name).filename();
      labelled_.push_back({spelled(fs::path(frames[i].sequence) / name.stem()), frames[i].sequence,
                           frame(frames[i].sequence, frames[i].number, name), label.key,
                           label.fault});
    }
    add_absent_frames(*labels_, labelled_);
    annotation_files_ = labels_->annotation_files();
    notes_ = labels_->notes();
  }

  /// Tells of the files in a folder that become neither frame nor label.
  void note_unused(const std::string& sequence, const ListedSequence& listed) {
    const ImageFolder& folder = listed.images;
    const std::string place = " in " + root_.written(listed.path);
    std::set<std::string> stems;
    for (const auto& [number, name] : folder.frames.frames()) {
      stems.insert(fs::path(name).stem().string());
    }
    std::vector<std::string> alone;
    std::vector<std::string> left_out = folder.left_out;
    for (const auto& [stem, name] : folder.sidecars) {
      if (labels_) {
        left_out.push_back(name);
      } else if (!stems.contains(stem)) {
        alone.push_back(name);
      }
    }
    if (labels_) {  // which may lie beside the images
      std::erase_if(left_out, [&](const std::string& name) {
        return std::ranges::binary_search(annotation_files_,
                                          root_.written(spelled(fs::path(listed.path) / name)));
      });
      std::ranges::sort(left_out);
    }
    if (!alone.empty()) notes_.push_back(counted(alone, "label", " without an image" + place));
    if (!sequence.empty() && !folder.folders.empty()) {
      notes_.push_back(counted(folder.folders, "folder", " left out" + place));
    }
    if (!left_out.empty()) notes_.push_back(counted(left_out, "file", " left out" + place));
  }

  SourceRoot root_;
  std::optional<double> frames_per_second_;
  LabelSchema schema_;
  std::unique_ptr<OwnLabels> labels_;  ///< null: none of a known form
  std::map<std::string, Sequence> sequences_;
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> annotation_files_;  ///< as FrameRef::path is written
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_images_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<ImagesDataset>(spec, base);
}

}  // namespace eventgan
