#include "pipeline/folder/source_comparison.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <exception>
#include <utility>
#include <variant>

#include "manifests/values/faults.h"
#include "manifests/values/placement.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/runtime/errors.h"
#include "stages/frames/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/labels/label_mapping.h"

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

std::string size_text(ImageSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

/// Frames are the same if they are the same files and places in them; times are not stored.
bool same_frames(const FramePair& a, const FramePair& b) {
  const auto same = [](const FrameRef& x, const FrameRef& y) {
    return x.path == y.path && x.index == y.index && x.video_frame == y.video_frame;
  };
  return same(a.previous, b.previous) && same(a.next, b.next) && a.label_index == b.label_index;
}

bool near(const std::array<double, 6>& a, const std::array<double, 6>& b) {
  constexpr double kTolerance = 1e-9;
  return std::ranges::equal(a, b, [](double x, double y) { return std::abs(x - y) <= kTolerance; });
}

/// The annotation, or what is wrong with it.
Outcome<Annotation> read_annotation(const Dataset& dataset, const std::string& label_key) {
  try {
    return dataset.annotation(label_key);
  } catch (const std::exception& error) {  // a key that the source does not know any more
    return SampleFault{error_line(error)};
  }
}

}  // namespace

SourceComparison::SourceComparison(JobManifest manifest) : manifest_(std::move(manifest)) {
  for (const SourceSpec& source : manifest_.sources) {
    try {
      datasets_.push_back(open_dataset(source, manifest_.directory));
    } catch (const std::exception& error) {
      datasets_.push_back(nullptr);
      notes_.push_back("labels of source " + source.root + " not compared: " + error_line(error));
    }
  }
}

void SourceComparison::renew_samples(Plan& plan) const {
  eventgan::renew_samples(manifest_, datasets_, plan);
}

std::vector<std::string> SourceComparison::faults(const PlannedShard& planned,
                                                  const ShardReader& reader) {
  std::vector<std::string> faults;
  const auto& dataset = datasets_.at(static_cast<std::size_t>(planned.source));
  if (!dataset) return faults;
  for (int slot = 0; slot < reader.header().sample_count; ++slot) {
    const ShardSample stored = reader.sample(slot);
    const PlannedSample& sample = planned.samples.at(static_cast<std::size_t>(slot));
    for (const std::string& fault :
         sample_faults(*dataset, sample, stored, reader.header().volume.size)) {
      faults.push_back(fault + " (sample " + std::to_string(slot) + ", " + stored.sample_id + ")");
    }
    compared_ += stored.valid;
  }
  return faults;
}

std::vector<std::string> SourceComparison::sample_faults(const Dataset& dataset,
                                                         const PlannedSample& planned,
                                                         const ShardSample& stored,
                                                         ImageSize volume_size) {
  if (stored.sample_id != planned.sample_id) {
    return {"expected the planned sample " + planned.sample_id + ", got another"};
  }
  // A hole that was filled since the plan was frozen: its frames were not known then.
  if (planned.fault.empty() && !same_frames(stored.pair, planned.pair)) {
    return {"expected the frames of the plan, " + planned.pair.previous.path + " and " +
            planned.pair.next.path + ", got " + stored.pair.previous.path + " and " +
            stored.pair.next.path};
  }
  const std::string place = dataset.label_place(planned.label_key);
  const Outcome<Annotation> read = read_annotation(dataset, planned.label_key);
  if (!stored.valid) {
    // What could not be read then may have been mended meanwhile; what was kept must be right.
    if (is_fault(read) || stored.annotation.original.empty() ||
        std::get<Annotation>(read).original == stored.annotation.original) {
      return {};
    }
    return {"expected the annotation as it stands in " + place + ", got other bytes"};
  }
  if (is_fault(read)) {
    return {"expected the annotation that the shard holds, got none: " +
            std::get<SampleFault>(read).reason};
  }
  const std::optional<ImageSize> size = manifest_.generator.kind == GeneratorKind::kEvents
                                            ? std::optional(dataset.sensor_size(planned.label_key))
                                            : picture_size(stored.pair.next.path);
  if (size && *size != stored.source_size) {
    return {"expected a source size of " + size_text(*size) + " as of " + stored.pair.next.path +
            ", got " + size_text(stored.source_size)};
  }
  if (stored.source_size.height <= 0 || stored.source_size.width <= 0) {
    return {"expected a source size, got " + size_text(stored.source_size)};
  }
  const Placement placement = eventgan::place(stored.source_size, manifest_.image);
  if (placement.volume != volume_size ||
      !near(placement.source_to_volume(), stored.source_to_volume)) {
    return {"expected source_to_volume of a picture of " + size_text(stored.source_size) +
            ", got another map"};
  }
  const auto& annotation = std::get<Annotation>(read);
  const Outcome<VolumeLabels> mapped = map_labels(annotation, placement, place);
  if (is_fault(mapped)) {
    return {"expected the annotation that the shard holds, got an unsound one: " +
            std::get<SampleFault>(mapped).reason};
  }
  return label_differences(stored, annotation, std::get<VolumeLabels>(mapped), place);
}

std::optional<ImageSize> SourceComparison::picture_size(const std::string& path) {
  const auto [entry, is_new] = sizes_.try_emplace(path);
  if (is_new) {
    const Outcome<ImageSize> found = probe_image_size(resolve(manifest_, path));
    if (!is_fault(found)) entry->second = std::get<ImageSize>(found);
  }
  return entry->second;
}

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
