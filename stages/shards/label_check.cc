#include "stages/shards/label_check.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace eventgan {
namespace {

constexpr double kTolerance_px = 0.01;

bool near(double a, double b) { return std::abs(a - b) <= kTolerance_px; }  // false for NaN

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

}  // namespace

std::vector<std::string> label_faults(const ShardHeader& header, const ShardSample& sample) {
  std::vector<std::string> faults;
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
