#include "stages/frames/mpii/detail/mpii_annotations.h"

#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "stages/base/archives/mat_file.h"
#include "stages/base/archives/mat_json.h"

namespace eventgan {

const LabelSchema& mpii_label_schema() {
  static const LabelSchema schema{
      {},
      {"r_ankle", "r_knee", "r_hip", "l_hip", "l_knee", "l_ankle", "pelvis", "thorax", "upper_neck",
       "head_top", "r_wrist", "r_elbow", "r_shoulder", "l_shoulder", "l_elbow", "l_wrist"}};
  return schema;
}

void refuse_json(const std::string& where, const std::string& expected,
                 const nlohmann::ordered_json& got) {
  constexpr std::size_t kReadable = 80;
  std::string text = dump_json(got, JsonLayout::kAsciiLine);
  if (text.size() > kReadable) text = text.substr(0, kReadable) + "...";
  throw std::invalid_argument("expected " + expected + ", got " + text + " at " + where);
}

namespace {

using Json = nlohmann::ordered_json;

/// A field, or nothing if it is absent or empty: MATLAB fills a struct array's gaps with [].
const Json* field(const Json& object, const char* name) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(name);
  if (found == object.end()) return nullptr;
  const bool is_empty = (found->is_array() && found->empty()) || *found == "";
  return is_empty ? nullptr : &*found;
}

/// The elements of a struct array, which is an object if it has one element.
std::vector<const Json*> elements(const Json* array) {
  std::vector<const Json*> found;
  if (array == nullptr) return found;
  if (!array->is_array()) return {array};
  for (const Json& element : *array) found.push_back(&element);
  return found;
}

std::optional<double> number(const Json& object, const char* name, const std::string& where) {
  const Json* value = field(object, name);
  if (value == nullptr) return std::nullopt;
  if (!value->is_number()) refuse_json(where + "." + name, "a finite number", *value);
  return value->get<double>();
}

Point from_one_based(double x, double y) { return {x - 1, y - 1}; }

Point parse_center(const Json& rect, const std::string& where) {
  const Json* position = field(rect, "objpos");
  if (position == nullptr) return kMissingPoint;
  const auto x = number(*position, "x", where + ".objpos");
  const auto y = number(*position, "y", where + ".objpos");
  if (!x && !y && position->is_object()) return kMissingPoint;
  if (!x || !y) refuse_json(where + ".objpos", "x and y", *position);
  return from_one_based(*x, *y);
}

std::optional<Rectangle> parse_head_box(const Json& rect, const std::string& where) {
  const auto left = number(rect, "x1", where), top = number(rect, "y1", where);
  const auto right = number(rect, "x2", where), bottom = number(rect, "y2", where);
  if (!left && !top && !right && !bottom) return std::nullopt;
  if (!left || !top || !right || !bottom) refuse_json(where, "all of x1, y1, x2, y2 or none", rect);
  const Point first = from_one_based(*left, *top);
  const Point second = from_one_based(*right, *bottom);
  return Rectangle{first.x, first.y, second.x, second.y};
}

int parse_visible(const Json& point, const std::string& where) {
  const Json* value = field(point, "is_visible");
  if (value == nullptr) return -1;
  if (*value == 1 || *value == "1" || *value == true) return 1;
  if (*value == 0 || *value == "0" || *value == false) return 0;
  refuse_json(where + ".is_visible", "0 or 1", *value);
}

std::vector<Joint> parse_joints(const Json& rect, const std::string& rect_where) {
  std::vector<Joint> joints(kMpiiJointCount, Joint{kMissingPoint, 0});
  std::vector<bool> seen(kMpiiJointCount);
  const Json* annopoints = field(rect, "annopoints");
  if (annopoints == nullptr) return joints;
  if (!annopoints->is_object()) refuse_json(rect_where + ".annopoints", "a struct", *annopoints);
  const auto points = elements(field(*annopoints, "point"));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::string where = rect_where + ".annopoints.point[" + std::to_string(i) + "]";
    const auto id = number(*points[i], "id", where);
    const auto x = number(*points[i], "x", where), y = number(*points[i], "y", where);
    if (!x || !y || !id) refuse_json(where, "x, y and id", *points[i]);
    if (!(*id >= 0 && *id < kMpiiJointCount) || std::trunc(*id) != *id) {
      refuse_json(where + ".id", "a whole number from 0 to 15", (*points[i])["id"]);
    }
    const auto joint = static_cast<std::size_t>(*id);
    if (seen[joint]) refuse_json(where + ".id", "each joint once", (*points[i])["id"]);
    seen[joint] = true;
    const int visible = parse_visible(*points[i], where);
    const Point at = from_one_based(*x, *y);
    joints[joint] = at == kMissingPoint ? Joint{kMissingPoint, 0} : Joint{at, visible};
  }
  return joints;
}

}  // namespace

bool has_mpii_persons(const Json& entry) {
  // What is not of the expected form counts as an annotation: its sample's fault must be seen.
  const auto has = [](const Json* part, const char* name) {
    return part != nullptr && (!part->is_object() || field(*part, name) != nullptr);
  };
  for (const Json* rect : elements(field(entry, "annorect"))) {
    if (!rect->is_object() || has(field(*rect, "annopoints"), "point") ||
        has(field(*rect, "objpos"), "x")) {
      return true;
    }
  }
  return false;
}

std::vector<Person> parse_mpii_persons(const Json& entry) {
  std::vector<Person> persons;
  const auto rects = elements(field(entry, "annorect"));
  for (std::size_t i = 0; i < rects.size(); ++i) {
    const Json& rect = *rects[i];
    const std::string where = "annorect[" + std::to_string(i) + "]";
    if (!rect.is_object()) refuse_json(where, "a struct", rect);
    Person person;
    person.joints = parse_joints(rect, where);
    person.center = parse_center(rect, where);
    person.scale = number(rect, "scale", where).value_or(-1);
    person.head_box = parse_head_box(rect, where);
    persons.push_back(std::move(person));
  }
  return persons;
}

namespace {

/// image.name of an element of annolist or annolist_keyframes; empty if it has none.
std::string image_name(const Json& element) {
  static const Json::json_pointer kName("/image/name");
  if (!element.contains(kName) || !element.at(kName).is_string()) return {};
  return element.at(kName).get<std::string>();
}

/// A field of RELEASE, empty if it has none of that name.
MatArray array_of(const MatArray& release, const char* name) {
  return mat_field(release, name).value_or(MatArray{});
}

/// Element `index` of `array`, if it has one. (single_person may be shorter than annolist.)
void copy_element(const MatArray& array, const char* name, std::size_t index, Json& entry) {
  if (index < array.size) entry[name] = mat_element_to_json(array, index);
}

std::string dump(const Json& json) { return dump_json(json); }

/// Turns what mat_to_json refuses into an error that names the file.
template <class Read>
auto reading(const std::filesystem::path& file, Read read) try {
  return read();
} catch (const std::invalid_argument& error) {
  throw InputError(std::string(error.what()) + ", in " + file.string());
}

std::vector<Json> read_keyframe_elements(const std::filesystem::path& file) {
  const MatVariable variable = read_mat_variable(file, "annolist_keyframes");
  return reading(file, [&] {
    std::vector<Json> elements;
    for (std::size_t i = 0; i < variable.array.size; ++i) {
      elements.push_back(mat_element_to_json(variable.array, i));
    }
    return elements;
  });
}

}  // namespace

std::vector<std::string> read_mpii_keyframes(const std::filesystem::path& keyframes) {
  std::vector<std::string> names;
  for (const Json& element : read_keyframe_elements(keyframes))
    names.push_back(image_name(element));
  return names;
}

std::vector<MpiiEntry> read_mpii_annotations(const std::filesystem::path& annotations,
                                             const std::filesystem::path& keyframes) {
  std::vector<Json> keyframe_elements;
  if (!keyframes.empty()) keyframe_elements = read_keyframe_elements(keyframes);
  const MatVariable release = read_mat_variable(annotations, "RELEASE");
  const auto field = [&](const char* name) {
    return reading(annotations, [&] { return array_of(release.array, name); });
  };
  const MatArray annolist = field("annolist"), img_train = field("img_train");
  const MatArray single_person = field("single_person"), act = field("act");
  const std::size_t count = annolist.size;
  const auto expect_count = [count](const char* name, std::size_t got,
                                    const std::filesystem::path& file) {
    if (got == count) return;
    throw InputError("expected " + std::to_string(count) + " elements in " + name +
                     ", as many as in annolist, got " + std::to_string(got) + ", in " +
                     file.string());
  };
  if (count == 0) {
    throw InputError("expected images in RELEASE.annolist, got none, in " + annotations.string());
  }
  expect_count("img_train", img_train.size, annotations);
  if (!keyframes.empty()) expect_count("annolist_keyframes", keyframe_elements.size(), keyframes);

  return reading(annotations, [&] {
    std::vector<MpiiEntry> entries;
    entries.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      Json entry = mat_element_to_json(annolist, i);
      MpiiEntry read;
      read.image = image_name(entry);
      if (read.image.empty()) {
        throw std::invalid_argument("expected image.name in annolist[" + std::to_string(i) +
                                    "], got none");
      }
      read.has_persons = has_mpii_persons(entry);
      copy_element(img_train, "img_train", i, entry);
      read.is_train = entry["img_train"] == 1 || entry["img_train"] == true;
      copy_element(single_person, "single_person", i, entry);
      copy_element(act, "act", i, entry);
      if (!keyframes.empty()) {
        read.keyframe = image_name(keyframe_elements[i]);
        entry["annolist_keyframes"] = std::move(keyframe_elements[i]);
      }
      read.json = dump(entry);
      entries.push_back(std::move(read));
    }
    return entries;
  });
}

}  // namespace eventgan
