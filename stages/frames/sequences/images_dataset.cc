#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/absent_frames.h"
#include "stages/frames/own_labels/label_readers.h"
#include "stages/frames/sequences/frames_dataset.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A folder of images.
struct ListedFolder {
  std::string name;  ///< below ROOT, as its samples are called; "" of ROOT itself
  std::string path;  ///< below ROOT: the name, or NAME/img1
  ImageFolder images;
};

/// What a sequence is called that is ROOT itself: after its folder as the manifest writes it, but
/// for names that most datasets have. The same wherever the manifest lies.
std::string name_of_root(const fs::path& root) {
  constexpr std::array<std::string_view, 6> kCommon = {"images",     "img1", "data",
                                                       "JPEGImages", ".",    ".."};
  std::string name = "frames";
  const std::vector<std::string> folders(root.begin(), root.end());
  for (const std::string& folder : folders) {
    const bool is_common = std::ranges::find(kCommon, folder) != kCommon.end();
    if (!is_common && !folder.empty() && folder != "/") name = folder;
  }
  return name;
}

class ImagesDataset final : public Dataset {
 public:
  ImagesDataset(const SourceSpec& spec, const fs::path& base, ImageFolder top)
      : root_(spec.root, base), frames_per_second_(spec.frames_per_second) {
    const auto note = [this](std::int64_t count, const char* noun, const std::string& rest) {
      if (count == 0) return;
      notes_.push_back(count_text(count, noun, rest + " in " + root_.written("")));
    };
    std::vector<ListedFolder> listed(1);
    listed[0].images = std::move(top);
    const bool is_flat = !listed[0].images.frames.empty();
    const std::vector<std::string> folders = listed[0].images.folders;
    std::vector<std::string> may_have_images = folders, of_labels;
    std::int64_t without_images = 0;
    if (is_flat) {
      listed[0].images.folders.clear();
    } else {
      // Of images that labels name, whatever their folder is called, these are the frames.
      if (!spec.labels) drop_label_folders(root_.on_disk(""), may_have_images);
      for (const std::string& name : folders) {
        const std::ptrdiff_t count = std::ssize(listed);
        if (!list_below(name, spec.labels, listed)) {
          ++without_images;
        } else if (!std::ranges::binary_search(may_have_images, name)) {
          listed.erase(listed.begin() + count, listed.end());
          of_labels.push_back(name);
        }
      }
    }
    for (const ListedFolder& folder : listed) {
      add_sequences(folder, /*are_stills=*/spec.pairs.stills.has_value());
    }
    if (sequences_.empty()) {
      throw InputError("expected images, folders of images, or videos, got none, in " +
                       root_.on_disk("").string());
    }
    if (spec.labels) {
      add_labelled(*spec.labels, base);
      std::ranges::sort(annotation_files_);
    } else {
      add_all(listed);
    }
    note(is_flat ? std::ssize(folders) : 0, "folder", " beside the images left out");
    for (const ListedFolder& folder : listed) note_unused(folder);
    note(without_images, "folder", " without images");
    if (!of_labels.empty()) {
      notes_.push_back(
          counted(of_labels, "folder", " of labels not taken for images in " + root_.written("")));
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(annotation_files_);
  }

  const LabelSchema& label_schema() const override { return labels_ ? labels_->schema() : schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> annotation_files() const override { return annotation_files_; }
  std::map<std::string, std::string> label_meanings() const override {
    return labels_ ? labels_->meanings() : std::map<std::string, std::string>();
  }
  std::vector<std::string> notes() const override { return notes_; }
  std::vector<std::string> warnings() const override {
    return labels_ ? labels_->warnings() : std::vector<std::string>();
  }

  PairedFrame paired_frame(const LabelledFrame& labelled, int steps) const override {
    if (labelled.frame.index == kAbsentFrame) return {PairedFrame::State::kMissing, labelled.frame};
    const auto found = sequences_.find(labelled.sequence);
    if (found == sequences_.end()) return {};
    const Sequence& sequence = found->second;
    const auto place = sequence.images.frames.at(labelled.frame.index, steps);
    if (place.state == PairedFrame::State::kBeyond) return {};
    return {place.state, frame(sequence, place.number, place.name)};
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
    std::string folder;  ///< ListedFolder::name
    std::string path;    ///< ListedFolder::path
    std::string key;     ///< SourceFrame::sequence
    NamedSequence images;
  };

  static std::string spelled(const fs::path& path) { return path.generic_string(); }

  /// The folder NAME, or NAME/img1 of a sequence as MOT has them (LabelReader::image_folder).
  ListedFolder list_folder_of(const std::string& name,
                              const std::optional<LabelSpec>& labels) const {
    ListedFolder listed{name, name, list_image_folder(root_.on_disk(name))};
    const std::string_view images = labels ? label_reader(labels->format).image_folder : "";
    const auto& folders = listed.images.folders;
    const bool is_below =
        listed.images.frames.empty() && std::ranges::find(folders, images) != folders.end();
    if (!is_below) return listed;
    const std::string below = name + "/" + std::string(images);
    return {name, below, list_image_folder(root_.on_disk(below))};
  }

  /// Adds a folder or, if it has no images, those in it that have. False if there are none.
  bool list_below(const std::string& name, const std::optional<LabelSpec>& labels,
                  std::vector<ListedFolder>& listed) const {
    ListedFolder folder = list_folder_of(name, labels);
    std::vector<ListedFolder> inner;
    if (folder.images.frames.empty()) {
      std::vector<std::string> may_have_images = folder.images.folders;
      if (!labels) drop_label_folders(root_.on_disk(name), may_have_images);
      for (const std::string& below : may_have_images) {
        ListedFolder found = list_folder_of(name + "/" + below, labels);
        if (!found.images.frames.empty()) inner.push_back(std::move(found));
      }
      std::erase_if(folder.images.folders, [&](const std::string& below) {
        return std::ranges::find(inner, name + "/" + below, &ListedFolder::name) != inner.end();
      });
    }
    const bool has_images = !folder.images.frames.empty() || !inner.empty();
    listed.push_back(std::move(folder));
    std::ranges::move(inner, std::back_inserter(listed));
    return has_images;
  }

  /// Stills are no sequence, whatever their names: those right in ROOT have none.
  void add_sequences(const ListedFolder& folder, bool are_stills) {
    NamedSequences named = name_sequences(folder.images.frames);
    if (are_stills && !named.sequences.empty()) {
      const bool is_numbered = named.sequences.size() == 1 && named.sequences[0].is_numbered;
      named = {};
      named.sequences.emplace_back().frames = folder.images.frames;
      named.sequences[0].is_numbered = is_numbered;
    }
    if (!named.are_told) {
      notes_.push_back("names of images tell no sequences: " +
                       count_text(std::ssize(folder.images.frames.frames()), "image") +
                       " in the order of their names in " + root_.written(folder.path));
    }
    // That of names which are numbers alone comes last: called as ROOT, it gives way to another.
    for (auto images = named.sequences.rbegin(); images != named.sequences.rend(); ++images) {
      const std::string key = spelled(fs::path(folder.name) / images->name);
      Sequence sequence{folder.name, folder.path, images->name.empty() ? folder.name : key,
                        std::move(*images)};
      const bool has_name = !sequence.key.empty() || are_stills;
      std::string name = has_name ? sequence.key : name_of_root(root_.written(""));
      while (sequences_.contains(name)) name += '*';
      sequences_.emplace(name, std::move(sequence));
    }
  }

  FrameRef frame(const Sequence& sequence, std::int64_t number, const std::string& name) const {
    FrameRef frame{root_.written(spelled(fs::path(sequence.path) / name)), number};
    if (frames_per_second_) {
      frame.time_s = static_cast<double>(number) /
                     (static_cast<double>(sequence.images.frames.stride()) * *frames_per_second_);
    } else if (const auto rate =
                   labels_ ? labels_->frames_per_second(sequence.key) : std::nullopt) {
      frame.time_s = static_cast<double>(number) / *rate;
    } else if (!sequence.images.times_s.empty()) {
      frame.time_s = sequence.images.times_s.at(static_cast<std::size_t>(number));
    }
    return frame;
  }

  /// Without labels of a known form every frame is a sample.
  void add_all(const std::vector<ListedFolder>& listed) {
    std::map<std::string_view, const ListedFolder*> folders;
    for (const ListedFolder& folder : listed) folders[folder.name] = &folder;
    for (const auto& [sequence_name, sequence] : sequences_) {
      const auto& sidecars = folders.at(sequence.folder)->images.sidecars;
      for (const auto& [number, name] : sequence.images.frames.frames()) {
        const fs::path below = fs::path(sequence.path) / name;
        LabelledFrame labelled;
        labelled.sample_id = spelled(below.parent_path() / below.stem());
        labelled.sequence = sequence_name;
        labelled.frame = frame(sequence, number, name);
        const auto sidecar = sidecars.find(below.stem().string());
        const bool has_label = sidecar != sidecars.end();
        labelled.label_key = spelled(has_label ? fs::path(sequence.path) / sidecar->second : below);
        if (has_label) annotation_files_.push_back(root_.written(labelled.label_key));
        labelled_.push_back(std::move(labelled));
      }
    }
  }

  void add_labelled(const LabelSpec& spec, const fs::path& base) {
    LabelledSource source{root_, {}, /*is_video=*/false};
    std::vector<decltype(sequences_)::const_iterator> sequence_of;
    for (auto sequence = sequences_.cbegin(); sequence != sequences_.cend(); ++sequence) {
      const auto& [path, key] = std::tie(sequence->second.path, sequence->second.key);
      for (const auto& [number, name] : sequence->second.images.frames.frames()) {
        source.frames.push_back({spelled(fs::path(path) / name), key, number, std::nullopt,
                                 sequence->second.images.is_numbered});
        sequence_of.push_back(sequence);
      }
    }
    labels_ = open_own_labels(spec, base, std::move(source));
    const std::vector<SourceFrame>& frames = labels_->source().frames;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const FrameLabel& label = labels_->labels()[i];
      if (label.key.empty()) continue;
      const auto& [sequence_name, sequence] = *sequence_of[i];
      const fs::path name = fs::path(frames[i].name).filename();
      labelled_.push_back({spelled(fs::path(sequence.folder) / name.stem()), sequence_name,
                           frame(sequence, frames[i].number, name), label.key, label.fault});
    }
    add_absent_frames(*labels_, labelled_);
    name_absent();
    annotation_files_ = labels_->annotation_files();
    std::ranges::copy(labels_->notes(), std::back_inserter(notes_));
  }

  /// An absent frame's sequence is the one of its folder that its name tells.
  void name_absent() {
    std::map<std::string, std::string> only;                       // by folder
    std::map<std::array<std::string, 3>, std::string> one_of_all;  // and around the number
    for (const auto& [name, sequence] : sequences_) {
      const std::string folder = root_.written(sequence.path);
      const NamedSequence& images = sequence.images;
      if (images.is_only) {
        only.emplace(folder, name);
      } else {
        one_of_all.emplace(std::array{folder, images.before, images.after}, name);
      }
    }
    for (LabelledFrame& labelled : labelled_) {
      if (labelled.frame.index != kAbsentFrame) continue;
      const fs::path path(labelled.frame.path);
      const std::string folder = path.parent_path().generic_string();
      const NumberInName number = find_number(path.stem().string());
      const auto alone = only.find(folder);
      const auto one = one_of_all.find({folder, number.before, number.after});
      if (alone != only.end()) labelled.sequence = alone->second;
      if (one != one_of_all.end()) labelled.sequence = one->second;
    }
  }

  /// Tells of the files in a folder that become neither frame nor label.
  void note_unused(const ListedFolder& listed) {
    const ImageFolder& folder = listed.images;
    const std::string place = " in " + root_.written(listed.path);
    std::set<std::string> stems;
    for (const auto& [number, name] : folder.frames.frames()) {
      stems.insert(fs::path(name).stem().string());
    }
    std::vector<std::string> left_out = folder.left_out;
    for (const auto& [stem, name] : folder.sidecars) {
      if (labels_ || !stems.contains(stem)) left_out.push_back(name);
    }
    if (labels_) {  // which may lie beside the images
      std::erase_if(left_out, [&](const std::string& name) {
        return std::ranges::binary_search(annotation_files_,
                                          root_.written(spelled(fs::path(listed.path) / name)));
      });
    }
    std::ranges::sort(left_out);
    if (!listed.name.empty() && !folder.folders.empty()) {
      notes_.push_back(counted(folder.folders, "folder", " left out" + place));
    }
    if (!left_out.empty()) notes_.push_back(counted(left_out, "file", " left out" + place));
  }

  SourceRoot root_;
  std::optional<double> frames_per_second_;
  LabelSchema schema_;
  std::unique_ptr<OwnLabels> labels_;          ///< null: none of a known form
  std::map<std::string, Sequence> sequences_;  ///< by LabelledFrame::sequence
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> annotation_files_;  ///< as FrameRef::path is written
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_images_dataset(const SourceSpec& spec, const fs::path& base,
                                             ImageFolder top) {
  return std::make_unique<ImagesDataset>(spec, base, std::move(top));
}

}  // namespace eventgan
