#include "stages/frames/kitti/kitti_label.h"

#include <algorithm>
#include <optional>

#include "stages/frames/kitti/text_table.h"

namespace eventgan {
namespace {

constexpr std::size_t kColumns = 15;

/// Takes one column after the other and remembers the first that is not the number it should be.
class ColumnReader {
 public:
  explicit ColumnReader(std::span<const std::string_view> columns) : columns_(columns) {}

  template <class Number>
  void read(Number& number, const char* name) {
    const std::string_view token = columns_.front();
    columns_ = columns_.subspan(1);
    if (const auto parsed = parse_number<Number>(token)) {
      number = *parsed;
    } else if (!complaint_) {
      complaint_ = std::string("expected ") +
                   (std::is_integral_v<Number> ? "a whole number" : "a finite number") + " for " +
                   name + ", got " + in_quotes(token);
    }
  }

  const std::optional<std::string>& complaint() const { return complaint_; }

 private:
  std::span<const std::string_view> columns_;
  std::optional<std::string> complaint_;
};

std::string class_list() {
  std::string list;
  for (const std::string& name : kitti_label_schema().class_names) {
    list += (list.empty() ? "" : ", ") + name;
  }
  return list;
}

}  // namespace

const LabelSchema& kitti_label_schema() {
  static const LabelSchema schema{{"Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist",
                                   "Tram", "Misc", "DontCare"},
                                  {}};
  return schema;
}

int kitti_class_id(std::string_view name) {
  if (name == "Person" || name == "Person (sitting)") name = "Person_sitting";
  const auto& names = kitti_label_schema().class_names;
  const auto found = std::ranges::find(names, name);
  return found == names.end() ? -1 : static_cast<int>(found - names.begin());
}

Outcome<Box> parse_kitti_object(std::span<const std::string_view> columns, int leading,
                                const std::string& where) {
  const std::size_t expected = kColumns + static_cast<std::size_t>(leading);
  if (columns.size() != expected && columns.size() != expected + 1) {
    return SampleFault{"expected " + std::to_string(expected) + " columns, got " +
                       std::to_string(columns.size()) + ", in " + where};
  }
  columns = columns.subspan(static_cast<std::size_t>(leading));

  Box box;
  box.class_id = kitti_class_id(columns[0]);
  if (box.class_id < 0) {
    return SampleFault{"expected one of " + class_list() + ", got " + in_quotes(columns[0]) +
                       ", in " + where};
  }
  box.ignore = box.class_id == kKittiDontCare;

  ColumnReader numbers(columns.subspan(1));
  numbers.read(box.truncation, "truncated");
  numbers.read(box.occlusion, "occluded");
  numbers.read(box.alpha, "alpha");
  numbers.read(box.xyxy.left, "left");
  numbers.read(box.xyxy.top, "top");
  numbers.read(box.xyxy.right, "right");
  numbers.read(box.xyxy.bottom, "bottom");
  constexpr const char* kNames3d[] = {"height", "width", "length", "x", "y", "z", "rotation_y"};
  for (std::size_t i = 0; i < box.box3d.size(); ++i) numbers.read(box.box3d[i], kNames3d[i]);
  if (numbers.complaint()) return SampleFault{*numbers.complaint() + ", in " + where};
  return box;
}

Outcome<Annotation> parse_kitti_label(std::string text, const std::string& path) {
  Annotation annotation;
  for (const TextLine& line : split_lines(text)) {
    const auto columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    auto box = parse_kitti_object(columns, 0, place_in_file(path, line.number));
    if (is_fault(box)) return std::get<SampleFault>(box);
    annotation.boxes.push_back(std::get<Box>(box));
  }
  annotation.original = std::move(text);
  return annotation;
}

}  // namespace eventgan
