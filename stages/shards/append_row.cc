#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "stages/shards/shard_rows.h"

namespace eventgan {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

void push(std::vector<double>& column, Point point) {
  column.insert(column.end(), {point.x, point.y});
}

void push(std::vector<double>& column, const Rectangle& box) {
  column.insert(column.end(), {box.left, box.top, box.right, box.bottom});
}

/// -1 stands for "none", as the datasets write it; no real box has these edges.
void push(std::vector<double>& column, const std::optional<Rectangle>& box) {
  push(column, box.value_or(Rectangle{-1, -1, -1, -1}));
}

/// Makes an optional column as long as if every row before `size` had NaN for "none".
void pad(std::vector<double>& column, std::size_t size) { column.resize(size, kNan); }

void push_camera(std::vector<double>& column, const std::optional<Intrinsics>& camera,
                 std::size_t persons_before) {
  if (!camera) return;
  pad(column, 4 * persons_before);
  column.insert(column.end(),
                {camera->focal_x, camera->focal_y, camera->centre_x, camera->centre_y});
}

void append_pair(const ShardHeader& header, const ShardSample& sample, PairColumns& to) {
  const FramePair& pair = sample.pair;
  to.sample_id.push_back(sample.sample_id);
  to.dataset.push_back(header.dataset);
  to.sequence.push_back(sample.sequence);
  to.prev_path.push_back(pair.previous.path);
  to.next_path.push_back(pair.next.path);
  to.prev_index.push_back(pair.previous.index);
  to.next_index.push_back(pair.next.index);
  to.prev_video_frame.push_back(pair.previous.video_frame);
  to.next_video_frame.push_back(pair.next.video_frame);
  to.gap_frames.push_back(pair.gap_frames);
  to.gap_s.push_back(pair.gap_s());
  to.label_index.push_back(pair.label_index);
  to.label_position.push_back(pair.label_position);
  to.source_size.insert(to.source_size.end(),
                        {sample.source_size.height, sample.source_size.width});
  to.source_to_volume.insert(to.source_to_volume.end(), sample.source_to_volume.begin(),
                             sample.source_to_volume.end());
}

void append_events(const ShardSample& sample, EventColumns& to) {
  const VolumeStatistics& statistics = sample.statistics;
  to.eta98.push_back(statistics.eta98);
  to.scale.push_back(sample.scale);
  to.nonzero_fraction.push_back(statistics.nonzero_fraction);
  to.max.push_back(statistics.max);
  to.sum_positive.push_back(statistics.sum_positive);
  to.sum_negative.push_back(statistics.sum_negative);
  to.flags.push_back(statistics.flags);
}

void append_box(const Box& box, const VolumeBox& mapped, BoxColumns& to) {
  push(to.xyxy, mapped.clipped);
  push(to.xyxy_unclipped, mapped.unclipped);
  push(to.xyxy_source, box.xyxy);
  to.class_id.push_back(box.class_id);
  to.truncation.push_back(box.truncation);
  to.occlusion.push_back(box.occlusion);
  to.alpha.push_back(box.alpha);
  to.box3d.insert(to.box3d.end(), box.box3d.begin(), box.box3d.end());
  to.ignore.push_back(mapped.ignore);
  to.ignore_source.push_back(box.ignore);
  to.track_id.push_back(box.track_id);
}

void append_person(const Person& person, const VolumePerson& mapped, PoseColumns& to) {
  const std::size_t persons_before = to.scale.size();
  for (const Joint& joint : person.joints) {
    push(to.joints_source, joint.at);
    to.visible.push_back(static_cast<std::int8_t>(joint.visible));
  }
  for (const Point& joint : mapped.joints) push(to.joints, joint);
  push(to.center, mapped.center);
  push(to.center_source, person.center);
  to.scale.push_back(person.scale);
  to.scale_volume.push_back(mapped.scale);
  push(to.head_box, mapped.head_box);
  push(to.head_box_source, person.head_box);
  if (!person.joints3d_mm.empty()) {
    pad(to.joints3d_mm, 3 * person.joints3d_mm.size() * persons_before);
    for (const auto& joint : person.joints3d_mm) {
      const auto place = joint.value_or(std::array{kNan, kNan, kNan});
      to.joints3d_mm.insert(to.joints3d_mm.end(), place.begin(), place.end());
    }
  }
  push_camera(to.camera, mapped.camera, persons_before);
  push_camera(to.camera_source, person.camera, persons_before);
  if (const auto& lens = person.distortion) {
    pad(to.camera_distortion, 5 * persons_before);
    to.camera_distortion.insert(to.camera_distortion.end(),
                                {lens->k1, lens->k2, lens->k3, lens->p1, lens->p2});
  }
}

/// Persons after the last with a 3-D pose or a camera.
void pad_optional(std::size_t joints, PoseColumns& poses) {
  const std::size_t persons = poses.scale.size();
  if (!poses.joints3d_mm.empty()) pad(poses.joints3d_mm, 3 * joints * persons);
  if (!poses.camera.empty()) pad(poses.camera, 4 * persons);
  if (!poses.camera_source.empty()) pad(poses.camera_source, 4 * persons);
  if (!poses.camera_distortion.empty()) pad(poses.camera_distortion, 5 * persons);
}

void check_labels(const LabelSchema& schema, const ShardSample& sample) {
  const auto expect = [&](bool holds, const char* what) {
    if (!holds)
      throw std::logic_error(std::string("expected ") + what + " (" + sample.sample_id + ")");
  };
  const Annotation& annotation = sample.annotation;
  const VolumeLabels& labels = sample.labels;
  expect(annotation.boxes.size() == labels.boxes.size(), "a volume box for each annotated box");
  expect(annotation.persons.size() == labels.persons.size(), "a volume pose for each person");
  for (const Box& box : annotation.boxes) {
    expect(box.class_id >= 0 && static_cast<std::size_t>(box.class_id) < schema.class_names.size(),
           "class ids that the schema names");
  }
  const std::size_t joints = schema.joint_names.size();
  for (const Person& person : annotation.persons) {
    expect(person.joints.size() == joints, "a joint for each name in the schema");
    expect(person.joints3d_mm.empty() || person.joints3d_mm.size() == joints,
           "a 3-D joint for each name in the schema, or none");
  }
  for (const VolumePerson& person : labels.persons) {
    expect(person.joints.size() == joints, "a volume joint for each name in the schema");
  }
}

}  // namespace

void append_row(const ShardHeader& header, const ShardSample& sample, ShardTables& tables) {
  const bool labelled =
      sample.valid || !sample.labels.boxes.empty() || !sample.labels.persons.empty();
  if (labelled) check_labels(header.label_schema, sample);

  append_events(sample, tables.events);
  append_pair(header, sample, tables.pairs);
  tables.original.emplace_back(sample.annotation.original.begin(),
                               sample.annotation.original.end());
  tables.valid.push_back(sample.valid);
  if (labelled) {
    for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
      append_box(sample.annotation.boxes[i], sample.labels.boxes[i], tables.boxes);
    }
    for (std::size_t i = 0; i < sample.labels.persons.size(); ++i) {
      append_person(sample.annotation.persons[i], sample.labels.persons[i], tables.poses);
    }
    pad_optional(header.label_schema.joint_names.size(), tables.poses);
  }
  tables.boxes.offsets.push_back(static_cast<std::int64_t>(tables.boxes.class_id.size()));
  tables.poses.offsets.push_back(static_cast<std::int64_t>(tables.poses.scale.size()));
}

}  // namespace eventgan
