#include "stages/frames/sequences/pictures_dataset.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/faults.h"
#include "manifests/strict_json/json_text_internal.h"
#include "stages/frames/folder_listing.h"
#include "stages/frames/sequences/lower_extension.h"
#include "stages/frames/sequences/picture_folder.h"
#include "stages/frames/source_root.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

class PicturesDataset final : public Dataset {
 public:
  PicturesDataset(const SourceSpec& spec, const fs::path& base)
      : root_(spec.root, base), frames_per_second_(spec.frames_per_second) {
    PictureFolder top = list_picture_folder(root_.on_disk(""));
    const auto note = [this](std::size_t count, const std::string& what) {
      if (count == 0) return;
      notes_.push_back(std::to_string(count) + " " + what + " in " + root_.written(""));
    };
    if (!top.frames.empty()) {
      note(top.folders.size(), "folders beside the pictures left out");
      add_sequence("", std::move(top));
    } else {
      note_unused(top, "");
      std::size_t without_pictures = 0;
      for (const std::string& name : top.folders) {
        PictureFolder folder = list_picture_folder(root_.on_disk(name));
        if (folder.frames.empty()) ++without_pictures;
        add_sequence(name, std::move(folder));
      }
      note(without_pictures, "folders without pictures");
    }
    if (labelled_.empty()) {
      throw InputError("expected pictures or folders of pictures, got none, in " +
                       root_.on_disk("").string());
    }
    std::ranges::sort(labelled_, {}, &LabelledFrame::sample_id);
    std::ranges::sort(sidecars_);
  }

  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  std::vector<std::string> annotation_files() const override { return sidecars_; }
  std::vector<std::string> notes() const override { return notes_; }

  Neighbour neighbour(const LabelledFrame& labelled, int steps) const override {
    const auto sequence = sequences_.find(labelled.sequence);
    if (sequence == sequences_.end()) return {};
    const auto place = sequence->second.at(labelled.frame.index, steps);
    if (place.state == Neighbour::State::kBeyond) return {};
    return {place.state, frame(sequence->first, place.number, place.name)};
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    if (lower_extension(label_key) != ".json") return Annotation{};
    Outcome<std::string> text = root_.read(label_key);
    if (auto* fault = std::get_if<SampleFault>(&text)) return std::move(*fault);
    Annotation annotation{std::get<std::string>(std::move(text)), {}, {}};
    try {
      parse_json_data(annotation.original, label_place(label_key));
    } catch (const std::runtime_error& error) {
      return SampleFault{error.what()};
    }
    return annotation;
  }

  std::string label_place(const std::string& label_key) const override {
    return root_.written(label_key);
  }

 private:
  static std::string spelled(const fs::path& path) { return path.generic_string(); }

  FrameRef frame(const std::string& sequence, std::int64_t number, const std::string& name) const {
    FrameRef frame{root_.written(spelled(fs::path(sequence) / name)), number};
    if (frames_per_second_) frame.time_s = static_cast<double>(number) / *frames_per_second_;
    return frame;
  }

  /// Tells of the files in a folder that become neither frame nor label.
  void note_unused(const PictureFolder& folder, const std::string& sequence) {
    const std::string place = " in " + root_.written(sequence);
    std::set<std::string> stems;
    for (const auto& [number, name] : folder.frames.frames()) {
      stems.insert(fs::path(name).stem().string());
    }
    std::vector<std::string> alone;
    for (const auto& [stem, name] : folder.sidecars) {
      if (!stems.contains(stem)) alone.push_back(name);
    }
    if (!alone.empty()) notes_.push_back(counted(alone, "labels without a picture" + place));
    if (!sequence.empty() && !folder.folders.empty()) {
      notes_.push_back(counted(folder.folders, "folders left out" + place));
    }
    if (!folder.left_out.empty()) {
      notes_.push_back(counted(folder.left_out, "files left out" + place));
    }
  }

  void add_sequence(const std::string& sequence, PictureFolder folder) {
    note_unused(folder, sequence);
    for (const auto& [number, name] : folder.frames.frames()) {
      const fs::path below = fs::path(sequence) / name;
      LabelledFrame labelled;
      labelled.sample_id = spelled(below.parent_path() / below.stem());
      labelled.sequence = sequence;
      labelled.frame = frame(sequence, number, name);
      const auto sidecar = folder.sidecars.find(below.stem().string());
      const bool has_label = sidecar != folder.sidecars.end();
      labelled.label_key = spelled(has_label ? fs::path(sequence) / sidecar->second : below);
      if (has_label) sidecars_.push_back(root_.written(labelled.label_key));
      labelled_.push_back(std::move(labelled));
    }
    sequences_.emplace(sequence, std::move(folder.frames));
  }

  SourceRoot root_;
  std::optional<double> frames_per_second_;
  LabelSchema schema_;
  std::map<std::string, NumberedSequence> sequences_;
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> sidecars_;  ///< as FrameRef::path is written
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_pictures_dataset(const SourceSpec& spec, const fs::path& base) {
  return std::make_unique<PicturesDataset>(spec, base);
}

}  // namespace eventgan
