#include "stages/frames/own_labels/yolo_text.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/values/outlines.h"
#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/dataset/label_name.h"
#include "stages/frames/listing/image_folder.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/detail/image_labels.h"

namespace eventgan {
namespace {

constexpr std::array<const char*, 17> kCocoJoints{
    "nose",           "left_eye",   "right_eye",   "left_ear",   "right_ear",   "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hip",
    "right_hip",      "left_knee",  "right_knee",  "left_ankle", "right_ankle"};
constexpr std::array<int, 17> kCocoFlip{0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15};

/// Reads the few keys that are needed; throws InputError.
class YoloYaml {
 public:
  YoloYaml(const YAML::Node& document, const std::string& path) : path_(path) {
    if (!document.IsMap()) refuse("keys and values", "something else");
    for (const auto& entry : document) {
      if (!entry.first.IsScalar()) continue;
      const std::string key = entry.first.Scalar();
      const bool is_known = key == "names" || key == "nc" || key == "kpt_shape" ||
                            key == "kpt_names" || key == "flip_idx";
      if (is_known && !keys_.emplace(key, entry.second).second) refuse(key + " once", "it twice");
    }
  }

  YoloSchema read() const {
    YoloSchema schema;
    const auto names = keys_.find("names");
    if (names == keys_.end()) refuse("names", "none");
    schema.names.class_names = read_names("names", names->second);
    if (const auto count = keys_.find("nc"); count != keys_.end()) {
      const std::size_t classes = schema.names.class_names.size();
      if (read_number("nc", count->second) != static_cast<int>(classes)) {
        refuse("nc: " + std::to_string(classes) + ", as many as names", count->second.Scalar());
      }
    }
    if (const auto shape = keys_.find("kpt_shape"); shape != keys_.end()) {
      read_joints(shape->second, schema);
    }
    return schema;
  }

 private:
  [[noreturn]] void refuse(const std::string& expected, const std::string& got) const {
    throw InputError("expected " + expected + ", got " + escape_controls(got) + ", in " + path_);
  }

  int read_number(const std::string& key, const YAML::Node& node) const {
    const auto number = node.IsScalar() ? parse_number<int>(node.Scalar()) : std::nullopt;
    if (!number) refuse("a whole number as " + key, node.IsScalar() ? node.Scalar() : "a list");
    return *number;
  }

  std::vector<std::string> read_names(const std::string& key, const YAML::Node& node) const {
    std::map<int, std::string> by_number;
    const auto add = [&](int number, const YAML::Node& name) {
      if (!name.IsScalar() || !is_label_name(name.Scalar())) {
        refuse("a name each in " + key, "another value");
      }
      if (!by_number.emplace(number, name.Scalar()).second) {
        refuse("each number once in " + key, std::to_string(number) + " twice");
      }
    };
    if (node.IsSequence()) {
      for (const auto& name : node) add(static_cast<int>(by_number.size()), name);
    } else if (node.IsMap()) {
      for (const auto& entry : node) add(read_number(key, entry.first), entry.second);
    }
    if (by_number.empty()) refuse("a list of names, or a map of them, as " + key, "none");
    const int last = static_cast<int>(by_number.size()) - 1;
    if (by_number.begin()->first != 0 || by_number.rbegin()->first != last) {
      refuse("the numbers 0.." + std::to_string(last) + " in " + key, "others");
    }
    std::vector<std::string> names;
    for (auto& [number, name] : by_number) names.push_back(std::move(name));
    check_distinct(key, names);
    return names;
  }

  void check_distinct(const std::string& key, const std::vector<std::string>& names) const {
    std::set<std::string> known;
    for (const std::string& name : names) {
      if (!known.insert(name).second) refuse("each name once in " + key, "\"" + name + "\" twice");
    }
  }

  void read_joints(const YAML::Node& shape, YoloSchema& schema) const {
    constexpr int kMostJoints = 1000;
    if (!shape.IsSequence() || shape.size() != 2) refuse("kpt_shape: [J, 2 or 3]", "another");
    const int count = read_number("kpt_shape", shape[0]);
    const int numbers = read_number("kpt_shape", shape[1]);
    schema.has_shape = true;
    if (count == 0 && numbers == 0) return;  // as Ultralytics has it where there is no kpt_shape
    if (count < 1 || count > kMostJoints || numbers < 2 || numbers > 3) {
      refuse("kpt_shape: [1.." + std::to_string(kMostJoints) + ", 2 or 3]",
             "[" + std::to_string(count) + ", " + std::to_string(numbers) + "]");
    }
    schema.has_visibility = numbers == 3;
    std::vector<std::string>& joints = schema.names.joint_names;
    joints = joint_names();
    const bool is_as_many = count == static_cast<int>(kCocoJoints.size());
    if (keys_.count("kpt_names") == 0 && is_as_many && !flips_others()) {
      joints.assign(kCocoJoints.begin(), kCocoJoints.end());
      schema.are_joints_assumed = true;
    }
    for (int i = 0;
         i < count && static_cast<int>(joints.size()) <= i && keys_.count("kpt_names") == 0; ++i) {
      joints.push_back(std::to_string(i));
    }
    if (static_cast<int>(joints.size()) != count) {
      refuse("kpt_names of " + std::to_string(count) + " joints", std::to_string(joints.size()));
    }
  }

  /// Whether `flip_idx` has other joints on the left and right than COCO's 17, as animals' have.
  bool flips_others() const {
    const auto flip = keys_.find("flip_idx");
    if (flip == keys_.end() || flip->second.IsNull()) return false;
    if (!flip->second.IsSequence()) refuse("a list of joints as flip_idx", "another value");
    std::vector<int> mirrored;
    for (const auto& joint : flip->second) mirrored.push_back(read_number("flip_idx", joint));
    return !mirrored.empty() && !std::ranges::equal(mirrored, kCocoFlip);
  }

  /// None if the file has none.
  std::vector<std::string> joint_names() const {
    const auto names = keys_.find("kpt_names");
    if (names == keys_.end()) return {};
    const bool by_class = names->second.IsMap() && names->second.size() > 0 &&
                          names->second.begin()->second.IsSequence();
    if (!by_class) return read_names("kpt_names", names->second);
    // An alias may stand for the same long list in each of many classes.
    constexpr std::size_t kMostNames = 1'000'000;
    std::size_t read = 0;
    std::optional<std::vector<std::string>> first;
    for (const auto& entry : names->second) {
      read += entry.second.size();
      if (read > kMostNames) refuse("at most 1,000,000 names in kpt_names", "more");
      auto of_class = read_names("kpt_names", entry.second);
      if (first && *first != of_class) refuse("the same kpt_names of all classes", "others");
      first = std::move(of_class);
    }
    return *std::move(first);
  }

  std::string path_;
  std::map<std::string, YAML::Node> keys_;
};

/// Reads one line; the first that is not as it should be is the complaint.
class YoloLine {
 public:
  YoloLine(const std::vector<std::string_view>& columns, const YoloSchema& schema, ImageSize image)
      : columns_(columns), schema_(schema), image_(image) {}

  /// `place` is the line's.
  void read(const std::string& place, Annotation& annotation) {
    const std::size_t joints = schema_.names.joint_names.size();
    const std::size_t numbers = schema_.has_visibility ? 3 : 2;
    const std::size_t expected = 5 + joints * numbers;
    const bool is_outline = joints == 0 && columns_.size() >= 7 && columns_.size() % 2 == 1;
    if (columns_.size() != expected && !is_outline) {
      const bool may_have_joints = joints == 0 && columns_.size() > 5 && columns_.size() % 3 == 2;
      throw BadLabel("expected " + std::to_string(expected) + " columns" +
                     (may_have_joints ? ", or kpt_shape in data.yaml" : "") + ", got " +
                     std::to_string(columns_.size()));
    }
    Box box;
    const auto number = parse_whole(columns_[0]);
    const std::int64_t classes = std::ssize(schema_.names.class_names);
    if (!number || *number < 0 || *number >= classes) {
      throw BadLabel("expected a class 0.." + std::to_string(classes - 1) + ", since there " +
                     (classes == 1 ? "is " : "are ") + count_text(classes, "name") + ", got " +
                     in_quotes(columns_[0]));
    }
    box.class_id = static_cast<int>(*number);
    std::size_t without_area = 0;
    if (is_outline) {
      std::vector<Point> corners;
      for (std::size_t i = 1; i < columns_.size(); i += 2) {
        corners.push_back({share(i) * image_.width, share(i + 1) * image_.height});
      }
      box.xyxy = bounds(Outline{{corners}});
      box.outline = outline_of_parts({corners}, &without_area);
    } else {
      box.xyxy = centred();
    }
    if (!add_box(box, image_, place, annotation)) return;
    note_parts_left_out(without_area, 1, place, annotation);
    if (joints == 0) return;
    Person person;
    person.box = box.xyxy;
    bool any = false;
    for (std::size_t i = 0; i < joints; ++i) {
      person.joints.push_back(joint(5 + i * numbers));
      any = any || person.joints.back().at != kMissingPoint;
    }
    if (any) annotation.persons.push_back(std::move(person));
  }

 private:
  Rectangle centred() const {
    const double x = share(1) * image_.width, y = share(2) * image_.height;
    const double half_width = share(3) * image_.width / 2;
    const double half_height = share(4) * image_.height / 2;
    return {x - half_width, y - half_height, x + half_width, y + half_height};
  }

  double number_at(std::size_t column) const {
    const auto number = parse_number<double>(columns_[column]);
    if (!number) {
      throw BadLabel("expected a number, got " + in_quotes(columns_[column]));
    }
    return *number;
  }

  double share(std::size_t column) const {
    constexpr double kTolerance = 0.01;  // as Ultralytics has it
    const double number = number_at(column);
    if (number >= -kTolerance && number <= 1 + kTolerance) return number;
    throw BadLabel("expected a share 0..1, got " + in_quotes(columns_[column]));
  }

  Joint joint(std::size_t column) const {
    constexpr double kHalf = 0.5;  // edges to pixels' centres
    Joint missing{kMissingPoint, 0};
    int visible = -1;
    if (schema_.has_visibility) {
      const double given = number_at(column + 2);
      if (given != 0 && given != 1 && given != 2) {
        throw BadLabel("expected a visibility 0, 1 or 2, got " + in_quotes(columns_[column + 2]));
      }
      if (given == 0) return missing;
      visible = given == 2 ? 1 : 0;
    } else if (number_at(column) == 0 && number_at(column + 1) == 0) {
      return missing;
    }
    const double x = std::clamp(share(column), 0.0, 1.0);
    const double y = std::clamp(share(column + 1), 0.0, 1.0);
    return {{x * image_.width - kHalf, y * image_.height - kHalf}, visible};
  }

  const std::vector<std::string_view>& columns_;
  const YoloSchema& schema_;
  ImageSize image_;
};

}  // namespace

YoloSchema parse_yolo_yaml(const std::string& text, const std::string& path) try {
  constexpr std::size_t kMostBytes = 1 << 20;
  if (text.size() > kMostBytes) {
    throw InputError("expected at most 1 MiB, got " + std::to_string(text.size()) + " bytes, in " +
                     path);
  }
  return YoloYaml(YAML::Load(text), path).read();
} catch (const YAML::Exception& error) {
  throw InputError("expected YAML, got '" + escape_controls(error.what()) + "', in " + path);
}

YoloSchema parse_yolo_classes(std::string_view text, const std::string& path) {
  YoloSchema schema;
  std::vector<std::string>& names = schema.names.class_names;
  for (const TextLine& line : split_lines(text)) {
    names.emplace_back(trimmed(line.bytes));
  }
  while (!names.empty() && names.back().empty()) names.pop_back();
  if (names.empty()) throw InputError("expected a name a line, got none, in " + path);
  std::set<std::string> known;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const bool is_sound = is_label_name(names[i]) && known.insert(names[i]).second;
    if (is_sound) continue;
    throw InputError("expected a name of its own a line, got " + in_quotes(names[i]) + ", in " +
                     place_in_file(path, static_cast<int>(i) + 1));
  }
  return schema;
}

bool has_yolo_names(const std::filesystem::path& yaml) {
  return ("\n" + beginning_of(yaml)).find("\nnames:") != std::string::npos;
}

std::vector<std::string> yolo_names_files(const std::filesystem::path& folder) {
  std::vector<std::string> files;
  const auto add = [&](std::initializer_list<const char*> names) {
    for (const char* name : names) {
      if (has_file(folder / name)) files.emplace_back(name);
    }
  };
  add({"data.yaml", "data.yml"});
  if (files.empty()) {
    const FolderListing listing = look_into(folder);
    for (const char* extension : {".yaml", ".yml"}) {
      for (const auto& name : names_with(listing, extension)) {
        if (has_yolo_names(folder / name)) files.push_back(name.string());
      }
    }
    if (files.size() > 1) files.clear();
  }
  add({"classes.txt", "obj.names", "_darknet.labels"});
  return files;
}

std::string yolo_names_file(const std::filesystem::path& folder) {
  std::vector<std::string> files = yolo_names_files(folder);
  return files.empty() ? "" : std::move(files.front());
}

YoloSchema parse_yolo_names(const std::string& text, const std::string& path) {
  const std::string extension = lower_extension(path);
  return extension == ".yaml" || extension == ".yml" ? parse_yolo_yaml(text, path)
                                                     : parse_yolo_classes(text, path);
}

int highest_yolo_class(std::string_view text) {
  constexpr int kMost = 100'000;
  int highest = -1;
  for (const TextLine& line : split_lines(text)) {
    const std::vector<std::string_view> columns = split_columns(line.bytes);
    const auto number = columns.empty() ? std::nullopt : parse_number<double>(columns[0]);
    const bool is_class = number && *number >= 0 && *number <= kMost;
    if (is_class) highest = std::max(highest, static_cast<int>(*number));
  }
  return highest;
}

YoloSchema numbered_yolo_classes(int highest) {
  YoloSchema schema;
  for (int i = 0; i <= highest; ++i) schema.names.class_names.push_back(std::to_string(i));
  return schema;
}

namespace {

/// Whether columns 1 to 4 are a box of the image, and the others joints in it.
bool fits_pose(const std::vector<double>& columns, std::size_t numbers) {
  constexpr double kSlack = 0.05;  // of the image, and of the box
  const double x = columns[1], y = columns[2], width = columns[3], height = columns[4];
  const auto is_within = [](double centre, double side) {
    return side > 0 && centre - side / 2 >= -kSlack && centre + side / 2 <= 1 + kSlack;
  };
  if (!is_within(x, width) || !is_within(y, height)) return false;
  for (std::size_t i = 5; i < columns.size(); i += numbers) {
    if (numbers == 3 && columns[i + 2] != 0 && columns[i + 2] != 1 && columns[i + 2] != 2) {
      return false;
    }
    if ((numbers == 3 && columns[i + 2] == 0) || (columns[i] == 0 && columns[i + 1] == 0)) continue;
    if (std::abs(columns[i] - x) > (0.5 + kSlack) * width ||
        std::abs(columns[i + 1] - y) > (0.5 + kSlack) * height) {
      return false;
    }
  }
  return true;
}

}  // namespace

void PoseEvidence::add(std::string_view text) {
  const int before = lines_;
  for (const TextLine& line : split_lines(text)) {
    const std::vector<std::string_view> tokens = split_columns(line.bytes);
    lines_ += !tokens.empty();
    if (tokens.size() <= 5) continue;
    ++longer_;
    are_outlines_ = are_outlines_ || (columns_ > 0 && tokens.size() != columns_);
    columns_ = tokens.size();
    std::vector<double> columns;
    for (const std::string_view token : tokens) {
      columns.push_back(parse_number<double>(token).value_or(-1));
    }
    for (const std::size_t numbers : {2, 3}) {
      if ((columns_ - 5) % numbers == 0) fitting_[numbers - 2] += fits_pose(columns, numbers);
    }
  }
  texts_ += lines_ > before;
}

std::string PoseEvidence::doubt() const {
  std::vector<std::string> readings;
  for (const std::size_t numbers : {2, 3}) {
    if (are_outlines_ || 2 * fitting_[numbers - 2] <= lines_) continue;
    const auto joints = static_cast<std::int64_t>((columns_ - 5) / numbers);
    readings.push_back(fmt::format("kpt_shape: [{}, {}] of boxes with {} of x y{}", joints, numbers,
                                   count_text(joints, "joint"), numbers == 3 ? " v" : ""));
  }
  if (readings.empty()) return {};
  if (columns_ % 2 == 1) {
    readings.push_back(fmt::format("kpt_shape: [0, 0] of outlines with {} corners", columns_ / 2));
  }
  return fmt::format("{}, since {} of {} columns may be either", fmt::join(readings, ", or "),
                     count_text(longer_, "line"), columns_);
}

Outcome<Annotation> parse_yolo_text(std::string text, const YoloSchema& schema, ImageSize image,
                                    const std::string& path) {
  Annotation annotation;
  std::set<std::string_view> known;
  for (const TextLine& line : split_lines(text)) {
    const auto columns = split_columns(line.bytes);
    if (columns.empty()) continue;
    const std::string place = place_in_file(path, line.number);
    if (!known.insert(trimmed(line.bytes)).second) {
      leave_out_again(place, annotation);
      continue;
    }
    try {
      YoloLine(columns, schema, image).read(place, annotation);
    } catch (const BadLabel& bad) {
      return bad.in(place);
    }
  }
  annotation.original = std::move(text);
  return annotation;
}

}  // namespace eventgan
