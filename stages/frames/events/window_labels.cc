#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/own_labels/detail/find_labels.h"
#include "stages/frames/own_labels/detail/yolo_text.h"

namespace eventgan {

bool is_window_label_file(const std::filesystem::path& file) { return file.extension() == ".txt"; }

std::optional<bool> is_window_label_text(const std::filesystem::path& file) {
  return is_yolo_text(beginning_of(file));
}

std::vector<std::filesystem::path> window_label_companions(const std::filesystem::path& file) {
  for (const std::filesystem::path& folder :
       {file.parent_path(), file.parent_path().parent_path()}) {
    const std::string name = yolo_names_file(folder);
    if (!name.empty()) return {folder / name};
  }
  return {};
}

RecordingLabels read_window_labels(const std::filesystem::path& file, ImageSize sensor,
                                   double time_s) {
  std::string text = InputFile(file).read_all();
  const std::vector<std::filesystem::path> names = window_label_companions(file);
  const YoloSchema classes = names.empty()
                                 ? numbered_yolo_classes(highest_yolo_class(text))
                                 : parse_yolo_names(InputFile(names[0]).read_all(), names[0]);
  Outcome<Annotation> read = parse_yolo_text(std::move(text), classes, sensor, file.string());
  if (is_fault(read)) throw InputError(read.fault().reason);
  return {.annotations = {{time_s, *std::move(read)}},
          .class_names = classes.names.class_names,
          .joint_names = classes.names.joint_names};
}

}  // namespace eventgan
