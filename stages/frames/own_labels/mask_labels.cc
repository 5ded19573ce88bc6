#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/files/sha256.h"
#include "manifests/values/outlines.h"
#include "stages/frames/decoding/index_mask.h"
#include "stages/frames/naming/file_per_image.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/detail/image_labels.h"
#include "stages/frames/own_labels/label_readers.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kOfDavis = "annotations";

const LabelFiles kMaskFiles{.extension = ".png",
                            .image_folders = {"images", "jpegimages", "img1", "imgs", "image_02"},
                            .label_folders = {"masks", "instances", kOfDavis},
                            .may_lie_beside = false};

// MOTS' numbers (www.vision.rwth-aachen.de/page/mots): class * 1000 + instance, and one of a region
// to leave out.
constexpr int kMotsClass = 1000;
constexpr int kMotsIgnored = 10 * kMotsClass;
bool is_of_mots(int index) {
  return (index >= kMotsClass && index < 3 * kMotsClass) || index == kMotsIgnored;
}

class MaskLabels : public FilePerImage {
 public:
  MaskLabels(const LabelSpec& spec, const fs::path& base, LabelledSource labelled)
      : FilePerImage(spec, base, std::move(labelled), kMaskFiles), is_mots_(find_mots()) {
    schema_.class_names = is_mots_ ? std::vector<std::string>{"car", "pedestrian", "ignore_region"}
                                   : std::vector<std::string>{"object"};
    if (is_mots_) notes_.push_back("masks read as MOTS': 1000 class + instance, 10000 is ignored");
    meanings_["masks"] = is_mots_ ? "1000 class + instance" : "objects";
    for (std::size_t i = 0; i < labels().size(); ++i) {
      const bool in_folder = source().frames[i].name.find('/') != std::string::npos;
      if (!labels()[i].key.empty() && in_folder) of_sequences_.insert(labels()[i].key);
    }
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override try {
    const std::string place = label_place(label_key);
    const fs::path file = root().on_disk(label_key);
    const Outcome<IndexMask> mask = IndexMask::read(file, place);
    if (is_fault(mask)) return mask.fault();
    const Outcome<ImageSize> size = image_size(label_key, mask->size());
    if (is_fault(size)) return size.fault();
    Annotation annotation;
    annotation.original = dump_json(
        nlohmann::json{
            {"mask", label_key}, {"objects", mask->indices()}, {"sha256", sha256_of_file(file)}},
        JsonLayout::kLine);
    for (const int index : mask->indices()) {
      Box box;
      if (is_mots_) {
        if (!is_of_mots(index)) {
          return SampleFault{"expected MOTS' numbers, 1000 to 2999 and 10000, got " +
                             std::to_string(index) + ", in " + place};
        }
        box.ignore = index == kMotsIgnored;
        box.class_id = box.ignore ? 2 : index / kMotsClass - 1;
      } else if (mask->bits() == 16 && index >= kMotsClass) {
        return SampleFault{
            "expected numbers below 1000, since the first mask's are not MOTS' (1000 class + "
            "instance), got " +
            std::to_string(index) + ", in " + place};
      }
      if (is_mots_ || of_sequences_.contains(label_key)) box.track_id = index;
      if (box.ignore) box.track_id = -1;
      box.outline = mask->outline(index);
      box.xyxy = bounds(box.outline);
      add_box(box, *size, place, annotation);
    }
    return annotation;
  } catch (const std::runtime_error& error) {  // of a file that is gone between two reads of it
    return SampleFault{error.what()};
  }

 private:
  /// By the first mask that has objects.
  bool find_mots() const {
    for (const FrameLabel& label : labels()) {
      if (label.key.empty()) continue;
      const auto mask = IndexMask::read(root().on_disk(label.key), label_place(label.key));
      if (is_fault(mask) || mask->indices().empty()) continue;
      return mask->bits() == 16 && std::ranges::all_of(mask->indices(), is_of_mots);
    }
    return false;
  }

  bool is_mots_;
  std::unordered_set<std::string> of_sequences_;  ///< label_keys
};

/// Whether some of the PNGs in a folder beside images, or in folders of it, are masks of objects.
/// Those in "Annotations" have palettes, as DAVIS' have: others there are of classes.
bool has_index_masks(const fs::path& masks, const FoundFrames& frames) {
  constexpr std::size_t kMost = 5;
  std::vector<fs::path> files;
  const auto add = [&](const fs::path& folder) {
    for (const fs::path& name : names_with(look_into(folder), kMaskFiles.extension)) {
      if (files.size() < kMost) files.push_back(folder / name);
    }
  };
  add(masks);
  std::vector<std::string> sequences = frames.folders;
  if (frames.is_video) sequences.assign(frames.stems.begin(), frames.stems.end());
  for (const std::string& folder : sequences) {
    if (files.size() < kMost) add(masks / folder);
  }
  // What is above images and masks may have any name.
  const auto own = std::ranges::mismatch(masks, frames.root).in1;
  const bool needs_palette = std::any_of(own, masks.end(), [](const fs::path& part) {
    return in_small_letters(part.string()) == kOfDavis;
  });
  return std::ranges::any_of(files, [&](const fs::path& file) {
    const auto mask = IndexMask::read(file, "");
    return !is_fault(mask) && !mask->indices().empty() && (mask->has_palette() || !needs_palette);
  });
}

LabelSearch find_masks(const FoundFrames& frames) {
  const fs::path masks = find_label_files(frames, kMaskFiles);
  if (masks.empty() || masks == frames.root || !has_index_masks(masks, frames)) return {};
  return {{masks}};
}

}  // namespace

constinit const LabelReader kMasksReader{LabelFormat::kMasks, open_labels<MaskLabels>, find_masks};

}  // namespace eventgan
