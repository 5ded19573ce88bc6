#include "pipeline/verification/label_comparison.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

namespace eventgan {
namespace {

constexpr double kTolerance_px = 1e-6;

// Far away from the picture another compiler's rounding alone is more than the tolerance.
bool near(double a, double b) {  // false for NaN
  return std::abs(a - b) <= kTolerance_px + 1e-12 * std::abs(b);
}

bool near(const Point& a, const Point& b) { return near(a.x, b.x) && near(a.y, b.y); }

bool near(const Rectangle& a, const Rectangle& b) {
  return near(a.left, b.left) && near(a.top, b.top) && near(a.right, b.right) &&
         near(a.bottom, b.bottom);
}

bool near(const Intrinsics& a, const Intrinsics& b) {
  return near(a.focal_x, b.focal_x) && near(a.focal_y, b.focal_y) && near(a.centre_x, b.centre_x) &&
         near(a.centre_y, b.centre_y);
}

template <class Value>
bool near(const std::optional<Value>& a, const std::optional<Value>& b) {
  return a.has_value() == b.has_value() && (!a || near(*a, *b));
}

bool near(const VolumeBox& a, const VolumeBox& b) {
  return near(a.clipped, b.clipped) && near(a.unclipped, b.unclipped) && a.ignore == b.ignore;
}

bool near(const VolumePerson& a, const VolumePerson& b) {
  return std::ranges::equal(a.joints, b.joints,
                            [](const Point& p, const Point& q) { return near(p, q); }) &&
         near(a.center, b.center) && near(a.scale, b.scale) && near(a.head_box, b.head_box) &&
         near(a.camera, b.camera);
}

/// Compares what is annotated and where it lies: boxes, or persons.
template <class Annotated, class Mapped>
void compare(const std::string& what, const std::string& place,
             const std::vector<Annotated>& stored, const std::vector<Annotated>& source,
             const std::vector<Mapped>& stored_places, const std::vector<Mapped>& places,
             std::vector<std::string>& differences) {
  if (stored.size() != source.size() || stored_places.size() != places.size()) {
    differences.push_back("expected as many of kind " + what + " as in " + place + ", " +
                          std::to_string(source.size()) + ", got " + std::to_string(stored.size()));
    return;
  }
  for (std::size_t i = 0; i < stored.size(); ++i) {
    const std::string number = what + " " + std::to_string(i);
    if (!(stored[i] == source[i])) {
      differences.push_back("expected " + number + " as annotated in " + place + ", got another");
    } else if (!near(stored_places[i], places[i])) {
      differences.push_back("expected " + number + " where " + place +
                            " puts it in the volume, got another place");
    }
  }
}

}  // namespace

std::vector<std::string> label_differences(const ShardSample& stored, const Annotation& source,
                                           const VolumeLabels& mapped, const std::string& place) {
  if (stored.annotation.original != source.original) {
    return {"expected the annotation as it stands in " + place + ", got other bytes"};
  }
  std::vector<std::string> differences;
  compare("box", place, stored.annotation.boxes, source.boxes, stored.labels.boxes, mapped.boxes,
          differences);
  compare("person", place, stored.annotation.persons, source.persons, stored.labels.persons,
          mapped.persons, differences);
  return differences;
}

}  // namespace eventgan
