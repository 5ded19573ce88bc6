#include "stages/frames/events/recording_labels.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/documents/strict_json.h"
#include "manifests/files/csv_records.h"
#include "manifests/files/input_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"
#include "stages/base/archives/array_json.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/frames/dataset/label_name.h"

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
class NumberedNames {
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

// ---- CSV

constexpr std::array<std::string_view, 7> kColumns = {"time_s", "left",  "top",     "right",
                                                      "bottom", "class", "category"};

using Places = std::vector<std::optional<std::size_t>>;

/// The place of each of kColumns by a table's header, none of a column that is absent: only the
/// last may be. A fault "expected X, got Y" where one is there twice, or another.
Outcome<Places> places_in(const CsvRecord& header) {
  Places places(kColumns.size());
  for (std::size_t i = 0; i < header.fields.size(); ++i) {
    const auto column =
        static_cast<std::size_t>(std::ranges::find(kColumns, header.fields[i]) - kColumns.begin());
    if (column == kColumns.size() || places[column]) {
      return SampleFault{fmt::format("expected columns {}, each once, got \"{}\"",
                                     fmt::join(kColumns, ", "), escape_controls(header.fields[i]))};
    }
    places[column] = i;
  }
  for (std::size_t i = 0; i + 1 < kColumns.size(); ++i) {
    if (!places[i]) return SampleFault{fmt::format("expected a column {}, got none", kColumns[i])};
  }
  return places;
}
constexpr std::size_t kCategory = 6;  // may be absent
using Fields = std::array<std::string_view, kColumns.size()>;

class CsvLabels {
 public:
  explicit CsvLabels(std::string file) : file_(std::move(file)) {}

  RecordingLabels read(std::string_view text) {
    CsvReader reader(text);
    while (const std::optional<CsvRecord> record = reader.next()) {
      line_ = record->line;
      if (!record->fault.empty()) {
        add_fault(record->fault);
      } else if (places_.empty()) {
        read_header(*record);
        if (!faults_.empty()) break;
      } else {
        read_row(*record);
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
  void add_fault(std::string_view reason) {
    constexpr std::size_t kMostText = 4000;
    if (faults_.size() > kMostText) return;
    if (!faults_.empty()) faults_ += '\n';
    faults_.append(reason);
    faults_ += ", in " + file_ + " (line " + std::to_string(line_) + ")";
  }

  void fault(std::string_view expected, std::string_view got) {
    add_fault(fmt::format("expected {}, got {}", expected, got));
  }

  static std::string quoted(std::string_view text) { return '"' + escape_controls(text) + '"'; }

  void read_header(const CsvRecord& header) {
    const auto places = places_in(header);
    if (is_fault(places)) return add_fault(places.fault().reason);
    places_ = *places;
    columns_ = header.fields.size();
  }

  void read_row(const CsvRecord& record) {
    // A time alone may do without the commas.
    if (record.fields.size() != columns_ && !(record.fields.size() == 1 && places_[0] == 0)) {
      fault(std::to_string(columns_) + " fields", std::to_string(record.fields.size()));
      return;
    }
    Fields row;
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (places_[i] && *places_[i] < record.fields.size()) row[i] = record.fields[*places_[i]];
    }
    const std::optional<double> time_s = parse_number<double>(row[0]);
    if (!time_s || std::abs(*time_s) > kLatest_s) {
      fault("a time in seconds", quoted(row[0]));
      return;
    }
    Annotation& annotation = labels_.annotations[*time_s];
    std::string_view bytes = record.bytes;
    while (bytes.ends_with('\n') || bytes.ends_with('\r')) bytes.remove_suffix(1);
    annotation.original.append(bytes).append("\n");
    const bool is_alone = std::ranges::all_of(row.begin() + 1, row.end(),
                                              [](std::string_view field) { return field.empty(); });
    if (!is_alone) read_box(row, annotation);
  }

  void read_box(const Fields& row, Annotation& annotation) {
    Box box;
    const std::array edges{&box.xyxy.left, &box.xyxy.top, &box.xyxy.right, &box.xyxy.bottom};
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const std::optional<double> edge = parse_number<double>(row[1 + i]);
      if (!edge || std::abs(*edge) > kFarthest_px) {
        return fault(fmt::format("{} as a number from -{:.0f} to {:.0f}", kColumns[1 + i],
                                 kFarthest_px, kFarthest_px),
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
  int line_ = 1;
  Places places_;  ///< empty: no header yet
  std::size_t columns_ = 0;
  NumberedNames classes_;
  RecordingLabels labels_;
};

// ---- JSON

constexpr std::string_view kFormat = "eventgan-labels";
constexpr int kVersion = 1;

constexpr std::int64_t kMostTracks = std::int64_t{1} << 53;  // as far as JSON's numbers are exact

double pixel(const StrictValue& value) { return value.number(-kFarthest_px, kFarthest_px); }

Rectangle read_rectangle(const StrictValue& value) {
  const auto edges = value.elements(4);
  if (edges.size() != 4) {
    if (!edges.empty()) value.fault("left, top, right and bottom");
    return {};
  }
  return {pixel(edges[0]), pixel(edges[1]), pixel(edges[2]), pixel(edges[3])};
}

Box read_box(const StrictValue& value, NumberedNames& classes) {
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
  if (const auto track = object.find("track"))
    box.track_id = track->integer(std::int64_t{0}, kMostTracks);
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
  NumberedNames classes;
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

// ---- NumPy

/// Beside the file; of an export of this program, which has one of all its recordings, where its
/// export.json is.
std::filesystem::path class_map_of(const std::filesystem::path& file) {
  constexpr char kName[] = "label_map_dictionary.json";
  constexpr int kMostFolders = 6;  // dsec/SPLIT/RECORDING/object_detections/left
  std::filesystem::path beside = file.parent_path() / kName;
  if (std::filesystem::exists(beside)) return beside;
  std::filesystem::path folder = std::filesystem::absolute(file);
  for (int i = 0; i < kMostFolders; ++i) {
    folder = folder.parent_path();
    if (std::filesystem::exists(folder / "export.json")) return folder / kName;
  }
  return beside;
}

/// Names of classes by their numbers; none: there is no such file.
std::optional<std::unordered_map<int, std::string>> read_class_map(
    const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return std::nullopt;
  std::unordered_map<int, std::string> names;
  std::unordered_set<std::string> known;
  const nlohmann::ordered_json document =
      parse_json_data(read_text_file(file), file.string(), JsonComments::kRefused);
  const auto refuse = [&](const std::string& got) {
    throw InputError(
        fmt::format(R"(expected {{"0": "car", ...}}, got {}, in {})", got, file.string()));
  };
  if (!document.is_object()) refuse("no object");
  for (const auto& [key, name] : document.items()) {
    int number = 0;
    const auto [stop, error] = std::from_chars(key.data(), key.data() + key.size(), number);
    if (error != std::errc() || stop != key.data() + key.size()) {
      refuse(fmt::format("\"{}\"", escape_controls(key)));
    }
    if (!name.is_string() || !is_label_name(name.get_ref<const std::string&>())) {
      refuse(fmt::format("another value of \"{}\"", escape_controls(key)));
    }
    const bool is_one = known.insert(name.get<std::string>()).second &&
                        names.try_emplace(number, name.get<std::string>()).second;
    if (!is_one) refuse(fmt::format(R"("{}": {} beside another)", key, dump_json(name)));
  }
  return names;
}

class BboxReader {
 public:
  explicit BboxReader(const std::filesystem::path& file) : file_(file.string()) {
    const std::string bytes = read_text_file(file);
    fields_ = parse_npy_fields(std::as_bytes(std::span(bytes)), file_);
    for (const NamedArray& field : fields_) {
      if (field.values.is_text()) {
        throw InputError("expected numbers, got text, in " + file_ + " (" + field.name + ")");
      }
    }
    names_ = read_class_map(class_map_of(file));
  }

  RecordingLabels read() {
    const TypedArray& t = find("t") != nullptr ? need("t") : need("ts");
    const TypedArray &x = need("x"), &y = need("y"), &w = need("w"), &h = need("h");
    const TypedArray& class_id = need("class_id");
    const TypedArray* const track_id = find("track_id");
    RecordingLabels labels;
    NumberedNames classes;
    for (row_ = 0; row_ < t.size(); ++row_) {
      const double time_s = value("t", t, 0, kLatest_s * kTicksPerSecond) / kTicksPerSecond;
      Box box;
      box.xyxy.left = value("x", x, -kFarthest_px, kFarthest_px);
      box.xyxy.top = value("y", y, -kFarthest_px, kFarthest_px);
      box.xyxy.right = box.xyxy.left + value("w", w, -kFarthest_px, kFarthest_px);
      box.xyxy.bottom = box.xyxy.top + value("h", h, -kFarthest_px, kFarthest_px);
      constexpr double kMostClasses = 1e6;
      box.class_id = classes.of(class_name(value("class_id", class_id, 0, kMostClasses)));
      if (track_id != nullptr) {
        box.track_id =
            static_cast<std::int64_t>(value("track_id", *track_id, -1, double(kMostTracks)));
      }
      Annotation& annotation = labels.annotations[time_s];
      annotation.boxes.push_back(box);
      nlohmann::ordered_json original;
      for (const NamedArray& field : fields_) {
        original[field.name] = to_json(field.values, row_);
      }
      annotation.original += original.dump() + "\n";
    }
    if (!faults_.empty()) throw InputError(faults_);
    labels.class_names = classes.names();
    return labels;
  }

 private:
  static constexpr double kTicksPerSecond = 1e6;

  const TypedArray* find(std::string_view name) const {
    const auto field = std::ranges::find(fields_, name, &NamedArray::name);
    return field == fields_.end() ? nullptr : &field->values;
  }

  const TypedArray& need(std::string_view name) const {
    if (const TypedArray* const array = find(name)) return *array;
    throw InputError(fmt::format("expected a field \"{}\" of boxes, got none, in {}", name, file_));
  }

  void fault(const std::string& expected, const std::string& got) {
    constexpr std::size_t kMostText = 4000;
    if (faults_.size() > kMostText) return;
    faults_ += fmt::format("{}expected {}, got {}, in {} (row {})", faults_.empty() ? "" : "\n",
                           expected, got, file_, row_);
  }

  /// 0 and a fault if it is no such number; NaN is none.
  double value(const char* name, const TypedArray& array, double least, double most) {
    const double number = array.number(row_);
    if (number >= least && number <= most) return number;
    fault(fmt::format("{} in {:g}..{:g}", name, least, most), fmt::format("{}", number));
    return 0;
  }

  std::string class_name(double number) {
    const int id = static_cast<int>(number);
    if (id != number) fault("a whole class_id", fmt::format("{}", number));
    if (!names_) return fmt::format("class {}", id);
    const auto name = names_->find(id);
    if (name != names_->end()) return name->second;
    fault("a class of label_map_dictionary.json", fmt::format("class_id {}", id));
    return "unknown";
  }

  std::string file_;
  std::vector<NamedArray> fields_;
  std::optional<std::unordered_map<int, std::string>> names_;
  std::size_t row_ = 0;
  std::string faults_;
};

}  // namespace

std::vector<std::filesystem::path> recording_label_companions(const std::filesystem::path& file) {
  if (file.extension() != ".npy") return {};
  return {class_map_of(file)};
}

bool is_label_table(const std::filesystem::path& file) {
  constexpr std::int64_t kMostHeaderBytes = std::int64_t{1} << 14;  // it may be of many events
  const InputFile input(file);
  const std::string text = input.read_between(0, std::min(kMostHeaderBytes, input.end_byte()));
  const auto header = CsvReader(text).next();
  return !header || std::ranges::any_of(header->fields, [](std::string_view field) {
    return std::ranges::find(kColumns, field) != kColumns.end();
  });
}

RecordingLabels read_recording_labels(const std::filesystem::path& file) try {
  if (file.extension() == ".npy") return BboxReader(file).read();
  const std::string text = read_text_file(file);
  return file.extension() == ".json" ? read_json(text, file.string())
                                     : CsvLabels(file.string()).read(text);
} catch (const InputError&) {
  throw;
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

}  // namespace eventgan
