#include "stages/labels/label_mapping.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <sstream>
#include <utility>

#include "manifests/values/outlines.h"

namespace eventgan {
namespace {

/// One axis of the map: an edge at `border` lies at `offset` in the volume.
struct Axis {
  double scale;
  double border;
  double offset;

  double edge_to_volume(double x) const { return (x - border) * scale + offset; }
  double edge_to_source(double x) const { return (x - offset) / scale + border; }
  // A pixel's centre lies half a pixel after its left edge.
  double point_to_volume(double x) const { return edge_to_volume(x + 0.5) - 0.5; }
  double point_to_source(double x) const { return edge_to_source(x + 0.5) - 0.5; }
};

Axis horizontal(const Placement& placement) {
  return {placement.scale_x(), static_cast<double>(placement.border_x),
          static_cast<double>(placement.offset_x)};
}

Axis vertical(const Placement& placement) {
  return {placement.scale_y(), static_cast<double>(placement.border_y),
          static_cast<double>(placement.offset_y)};
}

}  // namespace

Point to_volume(const Placement& placement, Point point) {
  return {horizontal(placement).point_to_volume(point.x),
          vertical(placement).point_to_volume(point.y)};
}

Point to_source(const Placement& placement, Point point) {
  return {horizontal(placement).point_to_source(point.x),
          vertical(placement).point_to_source(point.y)};
}

Rectangle to_volume(const Placement& placement, const Rectangle& box) {
  const Axis x = horizontal(placement);
  const Axis y = vertical(placement);
  return {x.edge_to_volume(box.left), y.edge_to_volume(box.top), x.edge_to_volume(box.right),
          y.edge_to_volume(box.bottom)};
}

Rectangle to_source(const Placement& placement, const Rectangle& box) {
  const Axis x = horizontal(placement);
  const Axis y = vertical(placement);
  return {x.edge_to_source(box.left), y.edge_to_source(box.top), x.edge_to_source(box.right),
          y.edge_to_source(box.bottom)};
}

Outline to_volume(const Placement& placement, const Outline& outline) {
  const Axis x = horizontal(placement);
  const Axis y = vertical(placement);
  Outline mapped = outline;
  for (auto& ring : mapped.rings) {
    for (Point& corner : ring) corner = {x.edge_to_volume(corner.x), y.edge_to_volume(corner.y)};
  }
  return mapped;
}

Intrinsics to_volume(const Placement& placement, const Intrinsics& camera) {
  const Axis x = horizontal(placement);
  const Axis y = vertical(placement);
  return {camera.focal_x * x.scale, camera.focal_y * y.scale, x.point_to_volume(camera.centre_x),
          y.point_to_volume(camera.centre_y)};
}

std::array<double, 12> to_volume(const Placement& placement,
                                 const std::array<double, 12>& projection) {
  const std::array<double, 6> map = placement.source_to_volume();  // [2][3]
  std::array<double, 12> mapped = projection;
  for (std::size_t i = 0; i < 4; ++i) {
    mapped[i] = map[0] * projection[i] + map[2] * projection[8 + i];
    mapped[4 + i] = map[4] * projection[4 + i] + map[5] * projection[8 + i];
  }
  return mapped;
}

Rectangle clip(const Rectangle& box, const Rectangle& area) {
  return {std::clamp(box.left, area.left, area.right), std::clamp(box.top, area.top, area.bottom),
          std::clamp(box.right, area.left, area.right),
          std::clamp(box.bottom, area.top, area.bottom)};
}

namespace {

/// The part of a ring where sign * coordinate <= sign * limit, `coordinate` being x or y
/// (Sutherland and Hodgman). A place in that part is wound around as often as before.
std::vector<Point> cut_ring(const std::vector<Point>& ring, double Point::*coordinate, double limit,
                            double sign) {
  std::vector<Point> cut;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Point& from = ring[i];
    const Point& to = ring[(i + 1) % ring.size()];
    const bool begins_inside = sign * from.*coordinate <= sign * limit;
    if (begins_inside) cut.push_back(from);
    if (begins_inside == (sign * to.*coordinate <= sign * limit)) continue;
    const double share = (limit - from.*coordinate) / (to.*coordinate - from.*coordinate);
    Point crossing{from.x + share * (to.x - from.x), from.y + share * (to.y - from.y)};
    crossing.*coordinate = limit;
    cut.push_back(crossing);
  }
  return cut;
}

}  // namespace

Outline clip(const Outline& outline, const Rectangle& area) {
  Outline clipped;
  for (const std::vector<Point>& ring : outline.rings) {
    std::vector<Point> cut = cut_ring(ring, &Point::x, area.right, 1);
    cut = cut_ring(cut, &Point::x, area.left, -1);
    cut = cut_ring(cut, &Point::y, area.bottom, 1);
    cut = cut_ring(cut, &Point::y, area.top, -1);
    if (has_area(cut)) clipped.rings.push_back(std::move(cut));
  }
  return clipped;
}

bool is_empty(const Rectangle& box) { return !(box.left < box.right && box.top < box.bottom); }

namespace {

/// What the volume shows of the image, which labels are clipped to.
Rectangle area_of(const Placement& placement) {
  const double left = placement.offset_x;
  const double top = placement.offset_y;
  return clip({left, top, left + placement.scaled.width, top + placement.scaled.height},
              {0, 0, static_cast<double>(placement.volume.width),
               static_cast<double>(placement.volume.height)});
}

// Each check returns what was expected and what was got, or nothing if all is well.
using Complaint = std::optional<std::string>;

template <class Numbers>
bool all_finite(const Numbers& numbers) {
  return std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); });
}

/// Numbers up to here stay finite in any volume. False of NaN.
bool all_near(std::initializer_list<double> numbers) {
  return std::ranges::all_of(numbers, [](double x) { return std::abs(x) <= kFarthest_px; });
}

bool is_near(Point point) { return all_near({point.x, point.y}); }

bool is_near(const Rectangle& box) { return all_near({box.left, box.top, box.right, box.bottom}); }

bool is_near(const Intrinsics& camera) {
  return all_near({camera.focal_x, camera.focal_y, camera.centre_x, camera.centre_y});
}

bool is_finite(const LensDistortion& lens) {
  return all_finite(std::initializer_list<double>{lens.k1, lens.k2, lens.k3, lens.p1, lens.p2});
}

bool overlaps(const Rectangle& box, ImageSize image) {
  return box.left < image.width && box.right > 0 && box.top < image.height && box.bottom > 0;
}

bool meet(const Rectangle& a, const Rectangle& b) {
  return a.left <= b.right && a.right >= b.left && a.top <= b.bottom && a.bottom >= b.top;
}

bool contains(ImageSize image, Point point) {
  return point.x >= -0.5 && point.x <= image.width - 0.5 && point.y >= -0.5 &&
         point.y <= image.height - 0.5;
}

std::ostream& operator<<(std::ostream& out, const Rectangle& box) {
  return out << "left " << box.left << ", top " << box.top << ", right " << box.right << ", bottom "
             << box.bottom;
}

std::ostream& operator<<(std::ostream& out, Point point) {
  return out << "(" << point.x << ", " << point.y << ")";
}

std::ostream& operator<<(std::ostream& out, const Intrinsics& camera) {
  return out << "f_x " << camera.focal_x << ", f_y " << camera.focal_y << ", c_x "
             << camera.centre_x << ", c_y " << camera.centre_y;
}

std::ostream& operator<<(std::ostream& out, const LensDistortion& lens) {
  return out << "k1 " << lens.k1 << ", k2 " << lens.k2 << ", k3 " << lens.k3 << ", p1 " << lens.p1
             << ", p2 " << lens.p2;
}

template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream out;
  (out << ... << parts);
  return out.str();
}

Complaint check(const Box& box, ImageSize image) {
  if (!is_near(box.xyxy)) return text("expected edges within 1e6 pixels, got ", box.xyxy);
  // A number beyond 3.4e38 is infinite in the 32 bits that these have.
  if (!std::isfinite(box.truncation))
    return text("expected a finite truncation, got ", box.truncation);
  if (!std::isfinite(box.alpha)) return text("expected a finite alpha, got ", box.alpha);
  for (const float number : box.box3d) {
    if (!std::isfinite(number)) return text("expected a finite box in 3-D, got ", number);
  }
  if (box.xyxy.right < box.xyxy.left || box.xyxy.bottom < box.xyxy.top) {
    return text("expected left <= right and top <= bottom, got ", box.xyxy);
  }
  for (const auto& ring : box.outline.rings) {
    for (const Point& corner : ring) {
      if (!is_near(corner)) return text("expected an outline within 1e6 pixels, got ", corner);
    }
  }
  if (!box.outline.empty() && !meet(bounds(box.outline), box.xyxy)) {
    return text("expected an outline over its box, ", box.xyxy, ", got one around ",
                bounds(box.outline));
  }
  if (!box.ignore && !overlaps(box.xyxy, image)) {
    return text("expected an overlap with the image of ", to_string(image), " pixels, got ",
                box.xyxy);
  }
  return std::nullopt;
}

Complaint check_joints(const std::vector<Joint>& joints, ImageSize image) {
  std::optional<Point> outside;
  bool any_inside = false;
  for (const Joint& joint : joints) {
    if (joint.at == kMissingPoint) continue;
    if (!is_near(joint.at)) return text("expected joints within 1e6 pixels, got ", joint.at);
    if (contains(image, joint.at)) {
      any_inside = true;
    } else if (!outside) {
      outside = joint.at;
    }
  }
  if (any_inside || !outside) return std::nullopt;
  return text("expected a joint inside the image of ", to_string(image),
              " pixels, got all annotated ones outside it, the first at ", *outside);
}

Complaint check(const Person& person, ImageSize image) {
  if (!is_near(person.center)) {
    return text("expected a centre within 1e6 pixels, got ", person.center);
  }
  if (!all_near({person.scale})) {
    return text("expected a scale of at most 1e6, got ", person.scale);
  }
  if (person.head_box && !is_near(*person.head_box)) {
    return text("expected a head box within 1e6 pixels, got ", *person.head_box);
  }
  for (const auto& joint : person.joints3d_mm) {
    if (!joint || all_finite(*joint)) continue;
    return text("expected finite joints in 3-D, got (", (*joint)[0], ", ", (*joint)[1], ", ",
                (*joint)[2], ") mm");
  }
  if (person.camera && !is_near(*person.camera)) {
    return text("expected a camera within 1e6 pixels, got ", *person.camera);
  }
  if (person.distortion && !is_finite(*person.distortion)) {
    return text("expected a finite lens distortion, got ", *person.distortion);
  }
  return check_joints(person.joints, image);
}

VolumeBox map(const Box& box, const Placement& placement) {
  const Rectangle unclipped = to_volume(placement, box.xyxy);
  const Rectangle area = area_of(placement);
  const Rectangle clipped = clip(unclipped, area);
  Outline outline = to_volume(placement, box.outline);
  const bool is_gone = is_empty(clipped) || (!outline.empty() && clip(outline, area).empty());
  return {clipped, unclipped, box.ignore || is_gone, std::move(outline)};
}

Point map_unless_missing(Point point, const Placement& placement) {
  return point == kMissingPoint ? point : to_volume(placement, point);
}

VolumePerson map(const Person& person, const Placement& placement) {
  VolumePerson mapped;
  mapped.joints.reserve(person.joints.size());
  for (const Joint& joint : person.joints) {
    mapped.joints.push_back(map_unless_missing(joint.at, placement));
  }
  mapped.center = map_unless_missing(person.center, placement);
  // One number for two axes: the geometric mean keeps the person's area right under any stretch.
  mapped.scale = person.scale < 0
                     ? person.scale
                     : person.scale * std::sqrt(placement.scale_x() * placement.scale_y());
  if (person.head_box) mapped.head_box = to_volume(placement, *person.head_box);
  if (person.box) mapped.box = to_volume(placement, *person.box);
  if (person.camera) mapped.camera = to_volume(placement, *person.camera);
  return mapped;
}

/// Checks and maps one kind of label; "box 2 of 8" says which one is at fault.
template <class Label, class Mapped>
std::optional<SampleFault> map_all(const std::vector<Label>& labels, const char* kind,
                                   const Placement& placement, const std::string& where,
                                   std::vector<Mapped>& mapped) {
  mapped.reserve(labels.size());
  for (const Label& label : labels) {
    if (const Complaint complaint = check(label, placement.source)) {
      return SampleFault{text(*complaint, ", in ", kind, " ", &label - labels.data() + 1, " of ",
                              labels.size(), ", in ", where)};
    }
    mapped.push_back(map(label, placement));
  }
  return std::nullopt;
}

}  // namespace

Outcome<VolumeLabels> map_labels(const Annotation& annotation, const Placement& placement,
                                 const std::string& where) {
  VolumeLabels labels;
  std::size_t corners = 0;
  for (const Box& box : annotation.boxes) corners += corner_count(box.outline);
  if (corners > kMostCorners) {
    return SampleFault{text("expected at most ", kMostCorners, " corners of outlines, got ",
                            corners, ", in ", where)};
  }
  if (auto fault = map_all(annotation.boxes, "box", placement, where, labels.boxes)) return *fault;
  if (auto fault = map_all(annotation.persons, "person", placement, where, labels.persons)) {
    return *fault;
  }
  if (annotation.projection) {
    labels.projection = to_volume(placement, *annotation.projection);
    for (const double number : *labels.projection) {
      if (std::isfinite(number)) continue;
      return SampleFault{
          text("expected a finite projection in the volume, got ", number, ", in ", where)};
    }
  }
  return labels;
}

}  // namespace eventgan
