#include "stages/frames/mpii/mpii_list_dataset.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "manifests/faults.h"
#include "manifests/strict_json/json_text_internal.h"
#include "stages/frames/mpii/mpii_annotations.h"
#include "stages/frames/mpii/mpii_frames.h"
#include "stages/frames/mpii/mpii_joints.h"
#include "stages/frames/mpii/mpii_list_file_internal.h"
#include "stages/frames/mpii/mpii_places.h"
#include "stages/frames/source_root.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

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
      if (frames_.is_without_picture(labelled_.back(), image)) ++unsized;
      if (spec.sequences && labelled_.back().sequence.empty()) ++alone;
    }
    sort_samples(labelled_, file_);
    if (alone > 0) {
      notes_.push_back(std::to_string(alone) +
                       " images whose frame is in no sequence: they have no neighbours");
    }
    if (unsized > 0) notes_.push_back(std::to_string(unsized) + " " + kWithoutPicture);
  }

  const LabelSchema& label_schema() const override { return mpii_label_schema(); }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  Neighbour neighbour(const LabelledFrame& frame, int steps) const override {
    return frames_.neighbour(frame, steps);
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
    if (auto* fault = std::get_if<SampleFault>(&scale)) {
      return SampleFault{fault->reason + " (sample " + without_extension(label_key) + ")"};
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
    scale_labels(std::get<LabelScale>(scale), annotation.persons);
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

}  // namespace eventgan
