#include "stages/frames/sources/outlined_dataset.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "stages/frames/dataset/wrapped_dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/index_mask.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/absent_frames.h"
#include "stages/frames/naming/frame_names.h"

namespace eventgan {
namespace fs = std::filesystem;

namespace {

/// The masks below a folder by what they are called without their ending.
std::map<std::string, std::string> masks_below(const SourceRoot& root) {
  constexpr int kDeepest = 8;
  std::map<std::string, std::string> masks;
  std::vector<std::string> folders{""};
  for (int level = 0; level < kDeepest && !folders.empty(); ++level) {
    std::vector<std::string> below;
    for (const std::string& folder : folders) {
      const std::string before = folder.empty() ? "" : folder + "/";
      for (const std::string& name : root.files_in(folder)) {
        const fs::path path(name);
        if (in_small_letters(path.extension().string()) != ".png" || name.starts_with('.'))
          continue;
        masks.emplace(before + path.stem().string(), before + name);
      }
      for (const std::string& name : root.folders_in(folder)) below.push_back(before + name);
    }
    folders = std::move(below);
  }
  return masks;
}

class OutlinedDataset final : public WrappedDataset {
 public:
  OutlinedDataset(std::unique_ptr<Dataset> dataset, const SourceSpec& spec, const fs::path& base)
      : WrappedDataset(std::move(dataset)),
        masks_(*spec.outlines, base),
        orientation_(orientation_of(spec.dataset)),
        base_(base) {
    masks_.require_folder("");
    find_masks(spec);
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    Outcome<Annotation> read = dataset_->annotation(label_key);
    const auto found = mask_of_.find(label_key);
    if (is_fault(read) || found == mask_of_.end()) return read;
    const auto& [image, mask] = found->second;
    const Outcome<ImageSize> size = image_sizes()->of(base_ / image, orientation_);
    if (is_fault(size)) return size.fault();
    auto fault = give_outlines(masks_.on_disk(mask), masks_.written(mask), *size,
                               label_place(label_key), *read);
    return fault ? Outcome<Annotation>(*std::move(fault)) : read;
  }

  ImageSizes* image_sizes() const override {
    ImageSizes* const others = dataset_->image_sizes();
    return others != nullptr ? others : &sizes_;
  }

  std::vector<std::string> annotation_files() const override {
    std::vector<std::string> files = dataset_->annotation_files();
    for (const auto& [label_key, mask] : mask_of_) files.push_back(masks_.written(mask.file));
    std::ranges::sort(files);
    files.erase(std::unique(files.begin(), files.end()), files.end());
    return files;
  }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = dataset_->notes();
    if (!note_.empty()) notes.push_back(note_);
    return notes;
  }

 private:
  struct Mask {
    std::string image;  ///< FrameRef::path
    std::string file;   ///< below the folder of masks
  };

  void find_masks(const SourceSpec& spec) {
    const std::map<std::string, std::string> masks = masks_below(masks_);
    std::map<std::string, std::string> of_videos;  // "STEM/12", without zeros
    for (const auto& [name, file] : masks) of_videos.emplace(video_frame_name(file), file);
    const std::string root = SourceRoot(spec.root, base_).written("");
    std::map<std::string, int> images;  // of one bare name
    std::vector<std::pair<fs::path, const LabelledFrame*>> named;
    for (const LabelledFrame& labelled : labelled_frames()) {
      if (labelled.frame.index == kAbsentFrame) continue;
      fs::path below = mask_name(root, labelled.frame);
      ++images[below.filename().string()];
      named.emplace_back(std::move(below), &labelled);
    }
    std::vector<std::string> without;
    for (const auto& [name, labelled] : named) {
      const auto& known = labelled->frame.video_frame < 0 ? masks : of_videos;
      const std::string bare = name.filename().string();
      auto mask = known.find(name.generic_string());
      if (mask == known.end() && images[bare] == 1) mask = known.find(bare);
      if (mask == known.end()) {
        without.push_back(labelled->sample_id);
      } else {
        mask_of_.emplace(labelled->label_key, Mask{labelled->frame.path, mask->second});
      }
    }
    if (mask_of_.empty()) {
      throw InputError("expected index masks of the labelled images, " +
                       (named.empty() ? "NAME" : named.front().first.generic_string()) +
                       ".png and so on, got of none of the " + std::to_string(named.size()) +
                       ", in " + masks_.written(""));
    }
    if (without.empty()) return;
    note_ = "no index mask for " + std::to_string(without.size()) + " of " +
            count_text(std::ssize(named), "labelled frame") + " in " + masks_.written("") +
            ": boxes without outlines, first of " + without.front();
  }

  SourceRoot masks_;
  ImageOrientation orientation_;
  fs::path base_;
  std::unordered_map<std::string, Mask> mask_of_;  ///< by label_key
  std::string note_;
  mutable ImageSizes sizes_;  ///< where the dataset has none
};

}  // namespace

std::unique_ptr<Dataset> with_outlines(std::unique_ptr<Dataset> dataset, const SourceSpec& spec,
                                       const fs::path& base) {
  return std::make_unique<OutlinedDataset>(std::move(dataset), spec, base);
}

}  // namespace eventgan
