#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "stages/shards/shard_rows.h"

namespace eventgan {
namespace {

Point point_at(const std::vector<double>& column, std::size_t row) {
  return {column[2 * row], column[2 * row + 1]};
}

Rectangle box_at(const std::vector<double>& column, std::size_t row) {
  const double* edge = &column[4 * row];
  return {edge[0], edge[1], edge[2], edge[3]};
}

std::optional<Rectangle> box_if_any(const std::vector<double>& column, std::size_t row) {
  const Rectangle box = box_at(column, row);
  return box == Rectangle{-1, -1, -1, -1} ? std::nullopt : std::optional(box);
}

/// Row `row` of an optional column of `width` numbers; none if the column is absent or all of them
/// are NaN.
const double* row_if_any(const std::vector<double>& column, std::size_t width, std::size_t row) {
  if (column.empty()) return nullptr;
  const double* first = &column[width * row];
  const bool any = !std::all_of(first, first + width, [](double x) { return std::isnan(x); });
  return any ? first : nullptr;
}

std::optional<Intrinsics> camera_if_any(const std::vector<double>& column, std::size_t row) {
  const double* number = row_if_any(column, 4, row);
  if (number == nullptr) return std::nullopt;
  return Intrinsics{number[0], number[1], number[2], number[3]};
}

std::optional<LensDistortion> distortion_if_any(const std::vector<double>& column,
                                                std::size_t row) {
  const double* number = row_if_any(column, 5, row);
  if (number == nullptr) return std::nullopt;
  return LensDistortion{number[0], number[1], number[2], number[3], number[4]};
}

FramePair pair_at(const PairColumns& from, std::size_t row) {
  FramePair pair;
  pair.previous = {from.prev_path[row], from.prev_index[row], from.prev_video_frame[row], 0};
  pair.next = {from.next_path[row], from.next_index[row], from.next_video_frame[row],
               from.gap_s[row]};
  pair.gap_frames = from.gap_frames[row];
  pair.label_index = from.label_index[row];
  pair.label_position = from.label_position[row];
  return pair;
}

VolumeStatistics statistics_at(const EventColumns& from, std::size_t row) {
  VolumeStatistics statistics;
  statistics.eta98 = from.eta98[row];
  statistics.max = from.max[row];
  statistics.nonzero_fraction = from.nonzero_fraction[row];
  statistics.sum_positive = from.sum_positive[row];
  statistics.sum_negative = from.sum_negative[row];
  statistics.flags = from.flags[row];
  return statistics;
}

Box annotated_box(const BoxColumns& from, std::size_t row) {
  Box box;
  box.class_id = from.class_id[row];
  box.xyxy = box_at(from.xyxy_source, row);
  box.truncation = from.truncation[row];
  box.occlusion = from.occlusion[row];
  box.alpha = from.alpha[row];
  for (std::size_t i = 0; i < box.box3d.size(); ++i) box.box3d[i] = from.box3d[7 * row + i];
  box.track_id = from.track_id[row];
  box.ignore = from.ignore_source[row] != 0;
  return box;
}

Person annotated_person(const PoseColumns& from, std::size_t joints, std::size_t row) {
  Person person;
  for (std::size_t j = row * joints; j < (row + 1) * joints; ++j) {
    person.joints.push_back({point_at(from.joints_source, j), from.visible[j]});
  }
  person.center = point_at(from.center_source, row);
  person.scale = from.scale[row];
  person.head_box = box_if_any(from.head_box_source, row);
  if (row_if_any(from.joints3d_mm, 3 * joints, row) != nullptr) {
    for (std::size_t j = row * joints; j < (row + 1) * joints; ++j) {
      const double* mm = row_if_any(from.joints3d_mm, 3, j);
      auto& joint = person.joints3d_mm.emplace_back();
      if (mm != nullptr) joint = {mm[0], mm[1], mm[2]};
    }
  }
  person.camera = camera_if_any(from.camera_source, row);
  person.distortion = distortion_if_any(from.camera_distortion, row);
  return person;
}

VolumePerson mapped_person(const PoseColumns& from, std::size_t joints, std::size_t row) {
  VolumePerson person;
  for (std::size_t j = row * joints; j < (row + 1) * joints; ++j) {
    person.joints.push_back(point_at(from.joints, j));
  }
  person.center = point_at(from.center, row);
  person.scale = from.scale_volume[row];
  person.head_box = box_if_any(from.head_box, row);
  person.camera = camera_if_any(from.camera, row);
  return person;
}

}  // namespace

ShardSample extract_row(const ShardHeader& header, const ShardTables& tables, int slot) {
  const auto row = static_cast<std::size_t>(slot);
  ShardSample sample;
  sample.valid = tables.valid[row] != 0;
  sample.sample_id = tables.pairs.sample_id[row];
  sample.sequence = tables.pairs.sequence[row];
  sample.pair = pair_at(tables.pairs, row);
  sample.source_size = {tables.pairs.source_size[2 * row], tables.pairs.source_size[2 * row + 1]};
  for (std::size_t i = 0; i < sample.source_to_volume.size(); ++i) {
    sample.source_to_volume[i] = tables.pairs.source_to_volume[6 * row + i];
  }
  sample.statistics = statistics_at(tables.events, row);
  sample.scale = tables.events.scale[row];
  sample.annotation.original.assign(tables.original[row].begin(), tables.original[row].end());

  const auto rows_of = [row](const std::vector<std::int64_t>& offsets, auto&& each) {
    for (std::int64_t k = offsets[row]; k < offsets[row + 1]; ++k)
      each(static_cast<std::size_t>(k));
  };
  rows_of(tables.boxes.offsets, [&](std::size_t k) {
    const BoxColumns& boxes = tables.boxes;
    sample.annotation.boxes.push_back(annotated_box(boxes, k));
    sample.labels.boxes.push_back(
        {box_at(boxes.xyxy, k), box_at(boxes.xyxy_unclipped, k), boxes.ignore[k] != 0});
  });
  const std::size_t joints = header.label_schema.joint_names.size();
  rows_of(tables.poses.offsets, [&](std::size_t k) {
    sample.annotation.persons.push_back(annotated_person(tables.poses, joints, k));
    sample.labels.persons.push_back(mapped_person(tables.poses, joints, k));
  });
  return sample;
}

}  // namespace eventgan
