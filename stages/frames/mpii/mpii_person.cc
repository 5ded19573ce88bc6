#include <cmath>
#include <optional>
#include <string>

#include "stages/frames/mpii/json_refusal_internal.h"
#include "stages/frames/mpii/mpii_joints.h"
#include "stages/frames/mpii/mpii_person_internal.h"

namespace eventgan {
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

}  // namespace eventgan
