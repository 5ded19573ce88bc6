#pragma once

#include <optional>
#include <vector>

#include "manifests/labels.h"

namespace eventgan {

/// A box in volume pixels, beside the annotation it comes from.
struct VolumeBox {
  Rectangle clipped;    ///< cut to the volume
  Rectangle unclipped;  ///< as mapped
  bool ignore = false;  ///< as annotated, or because a crop left nothing of the box
};

/// A person in volume pixels; joints and centre that were not annotated stay kMissingPoint.
struct VolumePerson {
  std::vector<Point> joints;
  Point center = kMissingPoint;
  double scale = -1;  ///< the annotated scale times sqrt(scale_x scale_y); -1 if not annotated
  std::optional<Rectangle> head_box;
  std::optional<Intrinsics> camera;
};

/// An annotation as it lies in the volume; entries in the order of Annotation.
struct VolumeLabels {
  std::vector<VolumeBox> boxes;
  std::vector<VolumePerson> persons;
};

}  // namespace eventgan
