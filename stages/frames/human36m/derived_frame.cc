#include "stages/frames/human36m/derived_frame.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace eventgan {

Person person_of_joints(const std::vector<double>& joints, const std::vector<double>& joints3d_mm) {
  Person person;
  for (std::size_t i = 0; i < joints.size(); i += 2) {
    person.joints.push_back({.at = {joints[i], joints[i + 1]}, .visible = -1});
  }
  for (std::size_t i = 0; i < joints3d_mm.size(); i += 3) {
    person.joints3d_mm.push_back(
        std::array{joints3d_mm[i], joints3d_mm[i + 1], joints3d_mm[i + 2]});
  }
  derive_frame(person);
  return person;
}

void derive_box(Person& person) {
  person.box.reset();
  for (const Joint& joint : person.joints) {
    const Point at = joint.at;
    if (at == kMissingPoint) continue;
    Rectangle& box =
        person.box ? *person.box : person.box.emplace(Rectangle{at.x, at.y, at.x, at.y});
    box = {std::min(box.left, at.x), std::min(box.top, at.y), std::max(box.right, at.x),
           std::max(box.bottom, at.y)};
  }
  // Of centres of pixels so far; of edges from here on.
  if (person.box) person.box->right += 1, person.box->bottom += 1;
}

void derive_frame(Person& person) {
  derive_box(person);
  if (!person.box) return;
  const double width = person.box->right - person.box->left - 1;
  const double height = person.box->bottom - person.box->top - 1;
  person.center = {person.box->left + width / 2, person.box->top + height / 2};
  person.scale = 1.2 * std::max(width, height) / 200;
}

}  // namespace eventgan
