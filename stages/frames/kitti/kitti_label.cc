#include "stages/frames/kitti/kitti_label.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "manifests/values/text_lines.h"

namespace eventgan {
namespace {

constexpr std::size_t kColumns = 15;
constexpr float kIgnoredLevel = 2;  // of truncation in KITTI tracking

template <class Number>
std::optional<Number> parse_column(std::string_view token) {
  if constexpr (std::is_integral_v<Number>) {
    const auto number = parse_whole(token);
    return number && std::in_range<Number>(*number) ? std::optional(static_cast<Number>(*number))
                                                    : std::nullopt;
  } else {
    return parse_number<Number>(token);
  }
}

/// Takes one column after the other and remembers the first that is not the number it should be.
class ColumnReader {
 public:
  explicit ColumnReader(std::span<const std::string_view> columns) : columns_(columns) {}

  template <class Number>
  void read(Number& number, const char* name) {
    read(number, name, std::is_integral_v<Number> ? "a whole number" : "a finite number",
         [](Number) { return true; });
  }

  /// The number must be -1 or one of those that `known` is true for; `meaning` names these.
  template <class Number, class Known>
  void read_or_unknown(Number& number, const char* name, const char* meaning, Known known) {
    read(number, name, meaning, [&](Number value) { return value == -1 || known(value); });
  }

  bool empty() const { return columns_.empty(); }

  const std::optional<std::string>& complaint() const { return complaint_; }

 private:
  template <class Number, class Fits>
  void read(Number& number, const char* name, const char* expected, Fits fits) {
    const std::string_view token = columns_.front();
    columns_ = columns_.subspan(1);
    const auto parsed = parse_column<Number>(token);
    if (parsed && fits(*parsed)) {
      number = *parsed;
    } else if (!complaint_) {
      complaint_ =
          std::string("expected ") + expected + " for " + name + ", got " + in_quotes(token);
    }
  }

  std::span<const std::string_view> columns_;
  std::optional<std::string> complaint_;
};

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

namespace {

struct DifficultyLimits {
  double height;
  int occlusion;
  float truncation;
};

/// Easy, moderate, hard: cpp/evaluate_object.cpp of the development kit.
constexpr DifficultyLimits kDifficulties[] = {{40, 0, 0.15f}, {25, 1, 0.3f}, {25, 2, 0.5f}};

}  // namespace

int kitti_difficulty(const Box& box) {
  if (box.occlusion < 0 || box.truncation < 0) return -1;
  const double height = box.xyxy.bottom - box.xyxy.top;
  for (int i = 0; i < std::ssize(kDifficulties); ++i) {
    const DifficultyLimits& limits = kDifficulties[i];
    if (height >= limits.height && box.occlusion <= limits.occlusion &&
        box.truncation <= limits.truncation) {
      return i;
    }
  }
  return -1;
}

Outcome<Box> parse_kitti_object(std::span<const std::string_view> columns, KittiColumns kind,
                                const std::string& where) {
  const bool tracking = kind == KittiColumns::kTracking;
  const std::size_t leading = tracking ? 2 : 0;
  const std::size_t expected = kColumns + leading;
  if (columns.size() != expected && columns.size() != expected + 1) {
    return SampleFault{"expected " + std::to_string(expected) + " columns, got " +
                       std::to_string(columns.size()) + ", in " + where};
  }
  columns = columns.subspan(leading);

  Box box;
  box.class_id = kitti_class_id(columns[0]);
  if (box.class_id < 0) {
    return SampleFault{fmt::format("expected one of {}, got {}, in {}",
                                   fmt::join(kitti_label_schema().class_names, ", "),
                                   in_quotes(columns[0]), where)};
  }

  ColumnReader numbers(columns.subspan(1));
  if (tracking) {
    numbers.read_or_unknown(box.truncation, "truncated", "0, 1, 2 or -1",
                            [](float level) { return level == 0 || level == 1 || level == 2; });
  } else {
    numbers.read_or_unknown(box.truncation, "truncated", "a number from 0 to 1, or -1",
                            [](float share) { return share >= 0 && share <= 1; });
  }
  numbers.read_or_unknown(box.occlusion, "occluded", "a whole number from 0 to 3, or -1",
                          [](int level) { return level >= 0 && level <= 3; });
  numbers.read(box.alpha, "alpha");
  numbers.read(box.xyxy.left, "left");
  numbers.read(box.xyxy.top, "top");
  numbers.read(box.xyxy.right, "right");
  numbers.read(box.xyxy.bottom, "bottom");
  constexpr const char* kNames3d[] = {"height", "width", "length", "x", "y", "z", "rotation_y"};
  for (std::size_t i = 0; i < box.box3d.size(); ++i) numbers.read(box.box3d[i], kNames3d[i]);
  double score = 0;
  if (!numbers.empty()) numbers.read(score, "score");
  if (numbers.complaint()) return SampleFault{*numbers.complaint() + ", in " + where};

  constexpr decltype(box.box3d) kTrackingUnknown{-1000, -1000, -1000, -10, -1, -1, -1};
  if (box.box3d == kTrackingUnknown) box.box3d = Box().box3d;
  box.ignore = box.class_id == kKittiDontCare || (tracking && box.truncation == kIgnoredLevel);
  if (!tracking && !box.ignore) box.difficulty = kitti_difficulty(box);
  return box;
}

Outcome<Annotation> parse_kitti_label(std::string text, const std::string& path) {
  Annotation annotation;
  for (const TextLine& line : split_lines(text)) {
    const auto columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    auto box = parse_kitti_object(columns, KittiColumns::kObject, place_in_file(path, line.number));
    if (is_fault(box)) return box.fault();
    annotation.boxes.push_back(*box);
  }
  annotation.original = std::move(text);
  return annotation;
}

}  // namespace eventgan
