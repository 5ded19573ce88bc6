#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/outlines.h"
#include "stages/frames/index_mask.h"
#include "stages/frames/own_labels/detail/file_per_image.h"
#include "stages/frames/own_labels/detail/find_labels.h"
#include "stages/frames/own_labels/detail/image_labels.h"

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

class MaskLabels : public FilePerImage {
 public:
  MaskLabels(const LabelSpec& spec, const fs::path& base, LabelledSource labelled)
      : FilePerImage(spec, base, std::move(labelled), kMaskFiles), is_mots_(find_mots()) {
    schema_.class_names = is_mots_ ? std::vector<std::string>{"car", "pedestrian", "ignore_region"}
                                   : std::vector<std::string>{"object"};
    meanings_["masks"] = is_mots_ ? "1000 class + instance" : "objects";
    for (std::size_t i = 0; i < labels().size(); ++i) {
      const bool in_folder = source().frames[i].name.find('/') != std::string::npos;
      if (!labels()[i].key.empty() && in_folder) of_sequences_.insert(labels()[i].key);
    }
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    const std::string place = label_place(label_key);
    const Outcome<IndexMask> mask = IndexMask::read(root().on_disk(label_key), place);
    if (is_fault(mask)) return mask.fault();
    const Outcome<ImageSize> size = image_size(label_key, mask->size());
    if (is_fault(size)) return size.fault();
    Annotation annotation;
    annotation.original = dump_json(
        nlohmann::json{{"mask", label_key}, {"objects", mask->indices()}}, JsonLayout::kLine);
    for (const int index : mask->indices()) {
      Box box;
      if (is_mots_) {
        box.ignore = index == kMotsIgnored;
        box.class_id = box.ignore ? 2 : index / kMotsClass - 1;
        if (box.class_id < 0 || box.class_id > (box.ignore ? 2 : 1)) {
          return SampleFault{"expected MOTS' numbers, 1000 to 2999 and 10000, got " +
                             std::to_string(index) + ", in " + place};
        }
      }
      if (is_mots_ || of_sequences_.contains(label_key)) box.track_id = index;
      if (box.ignore) box.track_id = -1;
      box.outline = mask->outline(index);
      box.xyxy = bounds(box.outline);
      add_box(box, *size, place, annotation);
    }
    return annotation;
  }

 private:
  /// By the first masks, of which one has objects.
  bool find_mots() const {
    constexpr int kMost = 20;
    int looked_at = 0;
    for (const FrameLabel& label : labels()) {
      if (label.key.empty()) continue;
      if (looked_at++ == kMost) break;
      const auto mask = IndexMask::read(root().on_disk(label.key), label_place(label.key));
      if (is_fault(mask) || mask->indices().empty()) continue;
      return mask->bits() == 16 && mask->indices().front() >= kMotsClass;
    }
    return false;
  }

  bool is_mots_;
  std::unordered_set<std::string> of_sequences_;  ///< label_keys
};

/// Whether some of the PNGs in a folder, or in folders of it, are masks of objects. Those in
/// "Annotations" have palettes, as DAVIS' have: others there are of classes.
bool has_index_masks(const fs::path& masks, const std::vector<std::string>& folders) {
  constexpr std::size_t kMost = 5;
  std::vector<fs::path> files;
  const auto add = [&](const fs::path& folder) {
    for (const fs::path& name : names_with(look_into(folder), kMaskFiles.extension)) {
      if (files.size() < kMost) files.push_back(folder / name);
    }
  };
  add(masks);
  for (const std::string& folder : folders) {
    if (files.size() < kMost) add(masks / folder);
  }
  const bool needs_palette = std::ranges::any_of(
      masks, [](const fs::path& part) { return in_small_letters(part.string()) == kOfDavis; });
  return std::ranges::any_of(files, [&](const fs::path& file) {
    const auto mask = IndexMask::read(file, "");
    return !is_fault(mask) && !mask->indices().empty() && (mask->has_palette() || !needs_palette);
  });
}

std::optional<fs::path> find_masks(const FoundFrames& frames, std::vector<std::string>&) {
  const fs::path masks = find_label_files(frames, kMaskFiles);
  if (masks.empty() || masks == frames.root || !has_index_masks(masks, frames.folders))
    return std::nullopt;
  return masks;
}

}  // namespace

constinit const LabelReader kMasksReader{LabelFormat::kMasks, open_labels<MaskLabels>, find_masks};

}  // namespace eventgan
