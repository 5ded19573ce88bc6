#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {

bool is_window_label_file(const std::filesystem::path& file) { return file.extension() == ".txt"; }

std::optional<bool> is_window_label_text(const std::filesystem::path& file) {
  const std::string text = beginning_of(file);
  const std::optional<bool> is_sound = is_yolo_text(text);
  if (is_sound.value_or(true)) return is_sound;
  for (const TextLine& line : split_lines(text)) {
    std::vector<std::string_view> columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    if (columns.size() != 5) return false;
    for (std::string_view& column : columns) {  // one mistake makes it no other text
      const std::string_view given = std::exchange(column, "0");
      if (is_yolo_text(fmt::format("{}", fmt::join(columns, " "))).value_or(false)) return true;
      column = given;
    }
    return false;
  }
  return false;
}

WindowLabels::Names& WindowLabels::names_of(const std::filesystem::path& file) {
  // Of "./a.txt" the folder above is another than ".".
  const std::filesystem::path folder =
      std::filesystem::absolute(file).lexically_normal().parent_path();
  const auto [names, is_new] = names_.try_emplace(folder);
  if (!is_new) return names->second;
  for (const std::filesystem::path& place : {folder, folder.parent_path()}) {
    const std::string name = yolo_names_file(place);
    if (name.empty()) continue;
    names->second.file = place / name;
    break;
  }
  return names->second;
}

std::vector<std::filesystem::path> WindowLabels::companions(const std::filesystem::path& file) {
  const Names& names = names_of(file);
  if (names.file.empty()) return {};
  return {names.file};
}

RecordingLabels WindowLabels::read(const std::filesystem::path& file, ImageSize sensor,
                                   double time_s) {
  std::string text = InputFile(file).read_all();
  Names& names = names_of(file);
  if (!names.file.empty() && !names.classes) {
    names.classes = parse_yolo_names(InputFile(names.file).read_all(), names.file);
  }
  const YoloSchema classes =
      names.classes ? *names.classes : numbered_yolo_classes(highest_yolo_class(text));
  Outcome<Annotation> read = parse_yolo_text(std::move(text), classes, sensor, file.string());
  if (is_fault(read)) throw InputError(read.fault().reason);
  return {.annotations = {{time_s, *std::move(read)}},
          .class_names = classes.names.class_names,
          .joint_names = classes.names.joint_names};
}

}  // namespace eventgan
