#include <algorithm>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include "stages/frames/own_labels/detail/file_per_image.h"
#include "stages/frames/own_labels/detail/find_labels.h"
#include "stages/frames/own_labels/detail/yolo_text.h"

namespace eventgan {
namespace {

constexpr std::string_view kNamesFile = "data.yaml", kClassesFile = "classes.txt";
const LabelFiles kYoloFiles{".txt", {"images"}, {"labels"}, kClassesFile};

class YoloLabels : public FilePerImage {
 public:
  YoloLabels(const LabelSpec& spec, const std::filesystem::path& base, LabelledSource labelled)
      : FilePerImage(spec, base, std::move(labelled), kYoloFiles) {
    read_classes();
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
      for (const std::string_view name : {kNamesFile, kClassesFile}) {
        if (!place.has_file(name)) continue;
        const std::string text = place.read_or_throw(name);
        const std::string path = place.written(name);
        classes_ =
            name == kClassesFile ? parse_yolo_classes(text, path) : parse_yolo_yaml(text, path);
        schema_ = classes_.names;
        annotation_files_.push_back(path);
        return;
      }
    }
    throw InputError("expected data.yaml or classes.txt with the classes' names, got neither, in " +
                     root().written("") + " and the folder above it");
  }

  YoloSchema classes_;
};

std::optional<std::filesystem::path> find_yolo(const FoundFrames& frames,
                                               std::vector<std::string>& remarks) {
  const std::filesystem::path labels = find_label_files(frames, kYoloFiles);
  if (labels.empty()) return std::nullopt;
  const bool is_beside = labels == frames.root;  // of texts there, folders above have none
  std::filesystem::path folder = labels;
  for (int level = 0; level < (is_beside ? 2 : 3); ++level, folder = folder.parent_path()) {
    for (const std::string_view name : {kNamesFile, kClassesFile}) {
      if (has_file(folder / name)) return is_beside ? labels : folder;
    }
  }
  if (!is_beside) {
    remarks.push_back("no data.yaml or classes.txt, so that YOLO's labels are left out: " +
                      labels.string());
  }
  return std::nullopt;
}

}  // namespace

constinit const LabelReader kYoloReader{LabelFormat::kYolo, open_labels<YoloLabels>, find_yolo};

}  // namespace eventgan
