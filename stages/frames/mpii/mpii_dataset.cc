#include "stages/frames/mpii/mpii_dataset.h"

#include <malloc.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/mpii/detail/mpii_annotations.h"
#include "stages/frames/mpii/mpii_frames.h"

namespace eventgan {
namespace {

class MpiiDataset final : public Dataset {
 public:
  MpiiDataset(MpiiPlaces places, const std::filesystem::path& base, const std::string& split)
      : places_(std::move(places)), frames_(base, places_.image_folders, places_.sequence_folders) {
    const auto keyframes =
        places_.keyframes.empty() ? std::filesystem::path() : base / places_.keyframes;
    take(read_mpii_annotations(base / places_.annotations, keyframes), split);
    sort_samples(labelled_, places_.annotations);
  }

  const LabelSchema& label_schema() const override { return mpii_label_schema(); }
  const std::vector<LabelledFrame>& labelled_frames() const override { return labelled_; }
  PairedFrame paired_frame(const LabelledFrame& frame, int steps) const override {
    return frames_.paired_frame(frame, steps);
  }
  std::vector<std::string> notes() const override { return notes_; }

  std::vector<std::string> annotation_files() const override {
    std::vector<std::string> files = {places_.annotations};
    if (!places_.keyframes.empty()) files.push_back(places_.keyframes);
    std::ranges::sort(files);
    return files;
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    const auto entry = entries_.find(label_key);
    if (entry == entries_.end()) {
      return SampleFault{"expected a labelled image, got none under " + label_key + ", in " +
                         places_.annotations};
    }
    try {
      Annotation annotation;
      annotation.persons = parse_mpii_persons(nlohmann::ordered_json::parse(entry->second.json));
      annotation.original = entry->second.json;
      const MpiiEntry& read = entry->second;
      const auto scale =
          frames_.label_scale(read.image, frames_.labelled(read.image, read.keyframe).frame.path);
      if (is_fault(scale)) {
        return SampleFault{scale.fault().reason + " (sample " + without_extension(read.image) +
                           ")"};
      }
      scale_labels(*scale, annotation.persons);
      return annotation;
    } catch (const std::invalid_argument& error) {
      return SampleFault{std::string(error.what()) + ", in " + label_place(label_key) +
                         " (sample " + without_extension(entry->second.image) + ")"};
    }
  }

  std::string label_place(const std::string& label_key) const override {
    return places_.annotations + ":" + label_key;
  }

 private:
  void take(std::vector<MpiiEntry> entries, const std::string& split) {
    std::size_t other_split = 0, unlabelled = 0, alone = 0, misnamed = 0, unsized = 0;
    std::string first_misnamed;
    for (std::size_t i = 0; i < entries.size(); ++i) {
      MpiiEntry& entry = entries[i];
      if (!entry.has_persons) {
        ++unlabelled;
        continue;
      }
      if ((split == "train" && !entry.is_train) || (split == "test" && entry.is_train)) {
        ++other_split;
        continue;
      }
      LabelledFrame frame = frames_.labelled(entry.image, entry.keyframe);
      frame.label_key = "annolist[" + std::to_string(i) + "]";
      if (frame.sequence.empty()) ++alone;
      if (frames_.is_without_image(frame, entry.image)) ++unsized;
      if (!frame.sequence.empty() && frame.sequence != frame.sample_id && misnamed++ == 0) {
        first_misnamed = entry.image + " in " + entry.keyframe;
      }
      entries_.emplace(frame.label_key, std::move(entry));
      labelled_.push_back(std::move(frame));
    }
    const auto note = [this](std::int64_t count, const std::string& noun, const std::string& rest) {
      if (count > 0) notes_.push_back(count_text(count, noun, rest));
    };
    note(unlabelled, "image", " without annotation in " + places_.annotations);
    note(other_split, "annotated image", " left out, not of split " + split);
    note(alone, "annotated image", " without a sequence folder, so without neighbours");
    note(unsized, "labelled frame", kWithoutImage);
    note(misnamed, "keyframe",
         " in a sequence not named as its image (first: " + first_misnamed + ")");
  }

  MpiiPlaces places_;
  MpiiFrames frames_;
  std::unordered_map<std::string, MpiiEntry> entries_;  ///< by label_key
  std::vector<LabelledFrame> labelled_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Dataset> open_mpii_dataset(const SourceSpec& spec,
                                           const std::filesystem::path& base) {
  auto dataset = std::make_unique<MpiiDataset>(find_mpii_places(spec, base), base, spec.split);
#ifdef __GLIBC__
  // The real file is read in many small pieces. Freed, they would stay with the process.
  malloc_trim(0);
#endif
  return dataset;
}

namespace {

bool is_mpii(const std::filesystem::path& root) { return !find_mpii_annotations(root).empty(); }

std::vector<FoundSource> complete_mpii(FoundSource found) {
  const bool has_sequences = any_folder(found.root, [](const std::string& name) {
    return name == "sequences" || name.starts_with(kMpiiBatchPrefix);
  });
  if (!has_sequences) found.remarks.push_back("no sequences (video frames): no pairs");
  return {std::move(found)};
}

constexpr std::array kMpiiLayouts{DatasetLayout{
    .fits = is_mpii, .complete = complete_mpii, .may_be_part = [](std::string_view name) {
      return name.starts_with("image") || name == "sequences";
    }}};

}  // namespace

constinit const DatasetReader kMpiiReader{.kind = DatasetKind::kMpii,
                                          .open = open_mpii_dataset,
                                          .layouts = kMpiiLayouts,
                                          .habits = kMpiiHabits};

}  // namespace eventgan
