#include "stages/shards/label_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace eventgan {
namespace {

constexpr double kTolerance_px = 0.01;

// Far away from the picture rounding alone is more than the tolerance.
bool near(double a, double b) {  // false for NaN
  return std::abs(a - b) <= kTolerance_px + 1e-12 * std::abs(b);
}

bool near(const Point& a, const Point& b) { return near(a.x, b.x) && near(a.y, b.y); }

bool near(const Rectangle& a, const Rectangle& b) {
  return near(a.left, b.left) && near(a.top, b.top) && near(a.right, b.right) &&
         near(a.bottom, b.bottom);
}

/// `/pairs/source_to_volume` as a map of points and of edges (manifests/placement.h has the
/// equations).
class SourceToVolume {
 public:
  explicit SourceToVolume(const std::array<double, 6>& matrix) : m_(matrix) {}

  Point operator()(const Point& p) const {
    if (p == kMissingPoint) return p;
    return {m_[0] * p.x + m_[1] * p.y + m_[2], m_[3] * p.x + m_[4] * p.y + m_[5]};
  }

  /// An edge lies half a pixel before the centre of the pixel with its number, here and there.
  Rectangle operator()(const Rectangle& r) const {
    const Point first = (*this)(Point{r.left - 0.5, r.top - 0.5});
    const Point last = (*this)(Point{r.right - 0.5, r.bottom - 0.5});
    return {first.x + 0.5, first.y + 0.5, last.x + 0.5, last.y + 0.5};
  }

 private:
  const std::array<double, 6>& m_;
};

Rectangle cut(const Rectangle& box, const ImageSize& size) {
  const double width = size.width;
  const double height = size.height;
  return {std::clamp(box.left, 0.0, width), std::clamp(box.top, 0.0, height),
          std::clamp(box.right, 0.0, width), std::clamp(box.bottom, 0.0, height)};
}

std::array<double, 2> numbers(const Point& p) { return {p.x, p.y}; }
std::array<double, 4> numbers(const Rectangle& r) { return {r.left, r.top, r.right, r.bottom}; }
std::array<double, 4> numbers(const Intrinsics& camera) {
  return {camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y};
}
std::array<double, 5> numbers(const LensDistortion& lens) {
  return {lens.k1, lens.k2, lens.k3, lens.p1, lens.p2};
}
std::array<double, 1> numbers(double x) { return {x}; }
template <class Number, std::size_t kCount>
std::array<Number, kCount> numbers(const std::array<Number, kCount>& all) {
  return all;
}

/// Columns in which a number is not finite.
std::vector<std::string> not_finite(const ShardSample& sample) {
  std::vector<std::string> faults;
  std::string whose;
  const auto expect_finite = [&](const char* column, const auto& value) {
    for (const double number : numbers(value)) {
      if (std::isfinite(number)) continue;
      faults.push_back("expected finite numbers in " + (column + whose) + ", got " +
                       std::to_string(number));
      return;
    }
  };
  const auto expect_finite_if_any = [&](const char* column, const auto& value) {
    if (value) expect_finite(column, *value);
  };
  for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
    whose = " of box " + std::to_string(i);
    const Box& source = sample.annotation.boxes[i];
    expect_finite("xyxy_source", source.xyxy);
    expect_finite("xyxy_unclipped", sample.labels.boxes[i].unclipped);
    expect_finite("xyxy", sample.labels.boxes[i].clipped);
    expect_finite("truncation", source.truncation);
    expect_finite("alpha", source.alpha);
    expect_finite("box3d", source.box3d);
  }
  for (std::size_t i = 0; i < sample.labels.persons.size(); ++i) {
    whose = " of person " + std::to_string(i);
    const Person& source = sample.annotation.persons[i];
    const VolumePerson& person = sample.labels.persons[i];
    for (const Joint& joint : source.joints) expect_finite("joints_source", joint.at);
    for (const Point& joint : person.joints) expect_finite("joints", joint);
    expect_finite("center_source", source.center);
    expect_finite("center", person.center);
    expect_finite("scale", source.scale);
    expect_finite("scale_volume", person.scale);
    expect_finite_if_any("head_box_source", source.head_box);
    expect_finite_if_any("head_box", person.head_box);
    for (const auto& joint : source.joints3d_mm) expect_finite_if_any("joints3d_mm", joint);
    expect_finite_if_any("camera_source", source.camera);
    expect_finite_if_any("camera", person.camera);
    expect_finite_if_any("camera_distortion", source.distortion);
  }
  return faults;
}

}  // namespace

std::vector<std::string> label_faults(const ShardHeader& header, const ShardSample& sample) {
  std::vector<std::string> faults = not_finite(sample);
  if (!faults.empty()) return faults;
  const auto expect = [&](bool holds, const std::string& what) {
    if (!holds) faults.push_back("expected " + what + ", got another place");
  };
  const SourceToVolume map(sample.source_to_volume);

  for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
    const VolumeBox& box = sample.labels.boxes[i];
    const std::string name = " of box " + std::to_string(i);
    const int class_id = sample.annotation.boxes[i].class_id;
    if (class_id < 0 || class_id >= static_cast<int>(header.label_schema.class_names.size())) {
      faults.push_back("expected class_id" + name + " to have a name, got " +
                       std::to_string(class_id));
    }
    expect(near(box.unclipped, map(sample.annotation.boxes[i].xyxy)),
           "xyxy_unclipped" + name + " where source_to_volume puts xyxy_source");
    expect(near(box.clipped, cut(box.unclipped, header.volume.size)) &&
               box.clipped == cut(box.clipped, header.volume.size),
           "xyxy" + name + " to be xyxy_unclipped cut to the volume");
  }
  for (std::size_t i = 0; i < sample.labels.persons.size(); ++i) {
    const Person& source = sample.annotation.persons[i];
    const VolumePerson& person = sample.labels.persons[i];
    const std::string name = " of person " + std::to_string(i);
    for (std::size_t j = 0; j < person.joints.size(); ++j) {
      expect(near(person.joints[j], map(source.joints[j].at)),
             "joint " + std::to_string(j) + name + " where source_to_volume puts joints_source");
    }
    expect(near(person.center, map(source.center)),
           "center" + name + " where source_to_volume puts center_source");
    if (person.head_box && source.head_box) {
      expect(near(*person.head_box, map(*source.head_box)),
             "head_box" + name + " where source_to_volume puts head_box_source");
    }
    expect(person.head_box.has_value() == source.head_box.has_value(),
           "head_box" + name + " if there is head_box_source");
  }
  return faults;
}

}  // namespace eventgan
