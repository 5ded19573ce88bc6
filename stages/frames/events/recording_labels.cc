#include "stages/frames/events/recording_labels.h"

#include <fmt/core.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "manifests/documents/detail/json_text.h"
#include "manifests/documents/detail/strict_json.h"
#include "manifests/values/faults.h"
#include "stages/base/files/input_file.h"

namespace eventgan {
namespace {

/// How a box counts in scores.
struct Category {
  int difficulty = -1;
  bool ignore = false;
};

constexpr std::array kCategoryWords{Word<Category>{"easy", {0, false}},
                                    Word<Category>{"hard", {2, false}},
                                    Word<Category>{"dont_care", {-1, true}}};

constexpr double kLatest_s = 1e12;  // no clock runs longer; what is beyond is a slip

/// Classes by their names, numbered as they first occur.
class ClassNumbers {
 public:
  int of(const std::string& name) {
    const auto [known, is_new] = numbers_.try_emplace(name, static_cast<int>(names_.size()));
    if (is_new) names_.push_back(name);
    return known->second;
  }

  const std::vector<std::string>& names() const { return names_; }

 private:
  std::unordered_map<std::string, int> numbers_;
  std::vector<std::string> names_;
};

/// A shard's text ends at a NUL, so that two names could become one; other control characters have
/// no place in a name either.
bool is_label_name(std::string_view text) { return !text.empty() && escape_controls(text) == text; }

// ---- CSV

constexpr std::array<std::string_view, 7> kColumns = {"time_s", "left",  "top",     "right",
                                                      "bottom", "class", "category"};
constexpr std::size_t kCategory = 6;  // may be absent
using Fields = std::array<std::string_view, kColumns.size()>;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    fields.push_back(trimmed(line.substr(begin, end - begin)));
    begin = end + 1;
  }
  return fields;
}

std::optional<double> number_of(std::string_view text) {
  double value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_number = error == std::errc() && stop == text.data() + text.size();
  return is_number && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

class CsvReader {
 public:
  explicit CsvReader(std::string file) : file_(std::move(file)) {}

  RecordingLabels read(std::string_view text) {
    constexpr std::string_view kMark = "\xEF\xBB\xBF";
    if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      const std::string_view line = text.substr(begin, end - begin);
      begin = end + 1;
      ++line_;
      if (!utf8::is_valid(line)) {
        fault("UTF-8", "other bytes");
        continue;
      }
      if (trimmed(line).empty()) continue;
      if (places_.empty()) {
        read_header(line);
        if (!faults_.empty()) break;
      } else {
        read_row(line);
      }
    }
    if (places_.empty() && faults_.empty()) {
      fault("a header line time_s,left,top,right,bottom,class,category", "none");
    }
    if (!faults_.empty()) throw InputError(faults_);
    labels_.class_names = classes_.names();
    return std::move(labels_);
  }

 private:
  void fault(std::string_view expected, std::string_view got) {
    constexpr std::size_t kMostText = 4000;
    if (faults_.size() > kMostText) return;
    if (!faults_.empty()) faults_ += '\n';
    faults_.append("expected ").append(expected).append(", got ").append(got);
    faults_ += ", in " + file_ + " (line " + std::to_string(line_) + ")";
  }

  static std::string quoted(std::string_view text) { return '"' + escape_controls(text) + '"'; }

  void read_header(std::string_view line) {
    for (const std::string_view name : split(line)) {
      const auto column = std::ranges::find(kColumns, name);
      const auto place = static_cast<std::size_t>(column - kColumns.begin());
      if (column == kColumns.end() || std::ranges::find(places_, place) != places_.end()) {
        fault("columns time_s, left, top, right, bottom, class, category, each once", quoted(name));
        return;
      }
      places_.push_back(place);
    }
    for (std::size_t place = 0; place < kCategory; ++place) {
      if (std::ranges::find(places_, place) == places_.end()) {
        fault("a column " + std::string(kColumns[place]), "none");
      }
    }
  }

  void read_row(std::string_view line) {
    const std::vector<std::string_view> fields = split(line);
    // A time alone may do without the commas.
    if (fields.size() != places_.size() && !(fields.size() == 1 && places_[0] == 0)) {
      fault(std::to_string(places_.size()) + " fields, none with a comma in it",
            std::to_string(fields.size()));
      return;
    }
    Fields row;
    for (std::size_t i = 0; i < fields.size(); ++i) row[places_[i]] = fields[i];
    const std::optional<double> time_s = number_of(row[0]);
    if (!time_s || std::abs(*time_s) > kLatest_s) {
      fault("a time in seconds", quoted(row[0]));
      return;
    }
    Annotation& annotation = labels_.annotations[*time_s];
    if (line.ends_with('\r')) line.remove_suffix(1);
    annotation.original.append(line).append("\n");
    const bool is_alone = std::ranges::all_of(row.begin() + 1, row.end(),
                                              [](std::string_view field) { return field.empty(); });
    if (!is_alone) read_box(row, annotation);
  }

  void read_box(const Fields& row, Annotation& annotation) {
    Box box;
    const std::array edges{&box.xyxy.left, &box.xyxy.top, &box.xyxy.right, &box.xyxy.bottom};
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const std::optional<double> edge = number_of(row[1 + i]);
      if (!edge || std::abs(*edge) > kFarthest_px) {
        return fault(fmt::format("{} within {:g} pixels", kColumns[1 + i], kFarthest_px),
                     quoted(row[1 + i]));
      }
      *edges[i] = *edge;
    }
    if (row[5].empty()) return fault("a class", "none");
    if (!is_label_name(row[5])) return fault("a class without control characters", quoted(row[5]));
    if (!row[kCategory].empty()) {
      const auto category =
          std::ranges::find(kCategoryWords, row[kCategory], &Word<Category>::word);
      if (category == kCategoryWords.end()) {
        return fault("easy, hard, dont_care or nothing", quoted(row[kCategory]));
      }
      box.difficulty = category->value.difficulty;
      box.ignore = category->value.ignore;
    }
    box.class_id = classes_.of(std::string(row[5]));
    annotation.boxes.push_back(box);
  }

  std::string file_;
  std::string faults_;
  std::size_t line_ = 0;
  std::vector<std::size_t> places_;  ///< in kColumns, of the file's columns
  ClassNumbers classes_;
  RecordingLabels labels_;
};

// ---- JSON

constexpr std::string_view kFormat = "eventgan-labels";
constexpr int kVersion = 1;

double pixel(const StrictValue& value) { return value.number(-kFarthest_px, kFarthest_px); }

Rectangle read_rectangle(const StrictValue& value) {
  const auto edges = value.elements(4);
  if (edges.size() != 4) {
    if (!edges.empty()) value.fault("left, top, right and bottom");
    return {};
  }
  return {pixel(edges[0]), pixel(edges[1]), pixel(edges[2]), pixel(edges[3])};
}

Box read_box(const StrictValue& value, ClassNumbers& classes) {
  Box box;
  StrictObject object = value.object();
  box.xyxy = {pixel(object.at("left")), pixel(object.at("top")), pixel(object.at("right")),
              pixel(object.at("bottom"))};
  box.class_id =
      classes.of(object.at("class").text("a class without control characters", is_label_name));
  if (const auto category = object.find("category")) {
    const Category counts = category->sound_choice(kCategoryWords).value_or(Category{});
    box.difficulty = counts.difficulty;
    box.ignore = counts.ignore;
  }
  object.finish();
  return box;
}

/// [x, y], or [x, y, visible]; [] of a joint that is not annotated.
Joint read_joint(const StrictValue& value) {
  Joint joint{kMissingPoint, 0};
  const auto numbers = value.elements();
  if (numbers.empty()) return joint;
  if (numbers.size() > 3 || numbers.size() < 2) {
    value.fault("[x, y], [x, y, visible] or []");
    return joint;
  }
  joint.at = {pixel(numbers[0]), pixel(numbers[1])};
  joint.visible = numbers.size() == 3 ? numbers[2].integer(0, 1) : -1;
  return joint;
}

Person read_person(const StrictValue& value, std::size_t joint_count) {
  Person person;
  StrictObject object = value.object();
  const StrictValue joints = object.at("joints");
  for (const StrictValue& joint : joints.elements()) person.joints.push_back(read_joint(joint));
  if (person.joints.size() != joint_count) {
    joints.fault("as many as joint_names, " + std::to_string(joint_count),
                 std::to_string(person.joints.size()));
  }
  if (const auto center = object.find("center")) {
    const auto place = center->elements(2);
    if (place.size() == 2) {
      person.center = {pixel(place[0]), pixel(place[1])};
    } else if (!place.empty()) {
      center->fault("[x, y]");
    }
  }
  if (const auto scale = object.find("scale")) person.scale = scale->number(0, kFarthest_px);
  if (const auto head_box = object.find("head_box")) person.head_box = read_rectangle(*head_box);
  object.finish();
  return person;
}

/// Each a name, and once: a joint is known by it alone.
std::vector<std::string> read_joint_names(const StrictValue& value) {
  std::vector<std::string> names;
  std::unordered_set<std::string> known;
  for (const StrictValue& element : value.elements()) {
    names.push_back(element.text("a joint's name without control characters", is_label_name));
    if (!known.insert(names.back()).second) element.fault("each joint once");
  }
  return names;
}

RecordingLabels read_json(std::string_view text, const std::string& file) {
  RecordingLabels labels;
  ClassNumbers classes;
  FaultList faults(file);
  if (const auto document = parse_json_text(text, faults)) {
    StrictObject object = StrictValue(*document, faults).object();
    if (object.has_format(kFormat, kVersion)) {
      if (const auto names = object.find("joint_names")) {
        labels.joint_names = read_joint_names(*names);
      }
      const StrictValue samples = object.at("samples");
      std::size_t number = 0;
      for (const StrictValue& value : samples.elements()) {
        StrictObject sample = value.object();
        const double time_s = sample.at("time_s").number(-kLatest_s, kLatest_s);
        Annotation annotation;
        annotation.original = dump_json(document->at("samples").at(number++));
        if (const auto boxes = sample.find("boxes")) {
          for (const StrictValue& box : boxes->elements()) {
            annotation.boxes.push_back(read_box(box, classes));
          }
        }
        if (const auto persons = sample.find("persons")) {
          for (const StrictValue& person : persons->elements()) {
            annotation.persons.push_back(read_person(person, labels.joint_names.size()));
          }
        }
        sample.finish();
        if (!labels.annotations.emplace(time_s, std::move(annotation)).second) {
          value.fault("each time once", "a time twice");
        }
      }
      object.finish();
    }
  }
  if (!faults.empty()) throw InputError(faults.text());
  labels.class_names = classes.names();
  return labels;
}

}  // namespace

RecordingLabels read_recording_labels(const std::filesystem::path& file) {
  const std::string text = read_text_file(file);
  return file.extension() == ".json" ? read_json(text, file.string())
                                     : CsvReader(file.string()).read(text);
}

}  // namespace eventgan
