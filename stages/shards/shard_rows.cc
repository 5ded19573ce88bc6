#include "stages/shards/shard_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/half.h"
#include "manifests/values/outlines.h"
#include "stages/shards/codec/quantization.h"

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

/// Row `row` of an optional column of `width` elements a row: nothing until the first row that has
/// `values`, from then on `none` where a row has not.
template <class Element>
void put(std::vector<Element>& column, std::span<const Element> values, std::size_t width,
         std::size_t row, const Element& none) {
  if (values.empty() && column.empty()) return;
  column.resize(width * row, none);
  column.insert(column.end(), values.begin(), values.end());
  column.resize(width * (row + 1), none);
}

void put(std::vector<double>& column, std::span<const double> values, std::size_t width,
         std::size_t row) {
  put(column, values, width, row, kNan);
}

void put(std::vector<double>& column, double value, std::size_t row) {
  put(column, std::isnan(value) ? std::span<const double>() : std::span(&value, 1), 1, row);
}

void put(std::vector<std::string>& column, const std::string& value, std::size_t row) {
  put<std::string>(column, {&value, value.empty() ? 0u : 1u}, 1, row, "");
}

template <std::size_t count>
void put(std::vector<double>& column, const std::optional<std::array<double, count>>& values,
         std::size_t row) {
  put(column, values ? std::span<const double>(*values) : std::span<const double>(), count, row);
}

void put(std::vector<double>& column, const std::optional<Rectangle>& box, std::size_t row) {
  using Edges = std::array<double, 4>;
  put(column,
      box ? std::optional(Edges{box->left, box->top, box->right, box->bottom}) : std::nullopt, row);
}

void put(std::vector<double>& column, const std::optional<Intrinsics>& camera, std::size_t row) {
  using Numbers = std::array<double, 4>;
  put(column,
      camera ? std::optional(
                   Numbers{camera->focal_x, camera->focal_y, camera->centre_x, camera->centre_y})
             : std::nullopt,
      row);
}

void put(std::vector<double>& column, const std::optional<ImageMotion>& motion, std::size_t row) {
  using Numbers = std::array<double, 4>;
  put(column,
      motion ? std::optional(Numbers{motion->x_px, motion->y_px, motion->angle_deg, motion->scale})
             : std::nullopt,
      row);
}

void append_flow(const PixelFlow& flow, ImageSize size, std::size_t row, ShardTables& to) {
  if (flow.empty() && to.flow.empty()) return;
  std::vector<Half> px;
  px.reserve(flow.px.size());
  for (const float each : flow.px) px.push_back(half_of(each));
  put<Half>(to.flow, px, 2 * size.pixel_count(), row, kHalfNan);
  to.flow_valid.resize(size.pixel_count() * row);
  to.flow_valid.insert(to.flow_valid.end(), flow.valid.begin(), flow.valid.end());
  to.flow_valid.resize(size.pixel_count() * (row + 1));
}

/// Empty if all is NaN.
PixelFlow flow_at(const ShardTables& from, ImageSize size, std::size_t row) {
  const std::size_t pixels = size.pixel_count();
  if (from.flow.empty() || from.flow_valid.empty()) return {};
  const std::span px = std::span(from.flow).subspan(2 * pixels * row, 2 * pixels);
  if (std::ranges::all_of(px, [](Half each) { return is_nan(each); })) return {};
  PixelFlow flow;
  flow.px.reserve(px.size());
  for (const Half each : px) flow.px.push_back(from_half(each.bits));
  const std::span valid = std::span(from.flow_valid).subspan(pixels * row, pixels);
  flow.valid.assign(valid.begin(), valid.end());
  return flow;
}

void append_pair(const ShardHeader& header, const ShardSample& sample, PairColumns& to) {
  const FramePair& pair = sample.pair;
  const FrameOrigin& origin = sample.origin;
  const std::size_t row = to.sample_id.size();
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
  put(to.prev_time_s, pair.previous.time_s, row);
  put(to.next_time_s, pair.next.time_s, row);
  put(to.subject, origin.subject, row);
  put(to.action, origin.action, row);
  put(to.camera, origin.camera, row);
  put(to.drive, origin.drive, row);
  put(to.motion, pair.motion, row);
  put(to.threshold, sample.threshold.value_or(kNan), row);
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

void append_box(const Box& box, const VolumeBox& mapped, const std::optional<ImageMotion>& motion,
                BoxColumns& to) {
  const std::size_t row = to.class_id.size();
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
  const auto difficulty = static_cast<std::int8_t>(box.difficulty);
  put<std::int8_t>(to.difficulty, {&difficulty, difficulty < 0 ? 0u : 1u}, 1, row, -1);
  const std::string text = outline_text(mapped.outline);
  const std::vector<char> outline(text.begin(), text.end());
  put<std::vector<char>>(to.outline, {&outline, outline.empty() ? 0u : 1u}, 1, row, {});
  put(to.motion, motion, row);
}

void append_person(const Person& person, const VolumePerson& mapped, PoseColumns& to) {
  const std::size_t row = to.scale.size();
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
  put(to.box, mapped.box, row);
  put(to.box_source, person.box, row);
  std::vector<double> joints3d;
  for (const auto& joint : person.joints3d_mm) {
    const auto place = joint.value_or(std::array{kNan, kNan, kNan});
    joints3d.insert(joints3d.end(), place.begin(), place.end());
  }
  put(to.joints3d_mm, joints3d, 3 * person.joints.size(), row);
  put(to.camera, mapped.camera, row);
  put(to.camera_source, person.camera, row);
  std::optional<std::array<double, 5>> lens;
  if (const auto& d = person.distortion) lens = {d->k1, d->k2, d->k3, d->p1, d->p2};
  put(to.camera_distortion, lens, row);
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
  const std::size_t tiles = tile_grid(header).pixel_count();
  if (sample.valid && sample.tiles.size() != tiles) {
    throw std::logic_error("expected the tiles of the header's grid (" + sample.sample_id + ")");
  }
  const std::size_t pixels = header.volume.size.pixel_count();
  if (!sample.flow.empty() &&
      (sample.flow.px.size() != 2 * pixels || sample.flow.valid.size() != pixels)) {
    throw std::logic_error("expected a flow of the volume's size (" + sample.sample_id + ")");
  }
  const bool labelled =
      sample.valid || !sample.labels.boxes.empty() || !sample.labels.persons.empty();
  if (labelled) check_labels(header.label_schema, sample);

  const std::size_t row = tables.valid.size();
  append_events(sample, tables.events);
  tables.events.tiles.insert(tables.events.tiles.end(), sample.tiles.begin(), sample.tiles.end());
  tables.events.tiles.resize(tiles * (row + 1));  // a quarantined sample has none
  if (tiles > 0) {
    const double fraction = sample.valid ? generated_fraction(sample) : 0;
    tables.events.generated_fraction.push_back(static_cast<float>(fraction));
  }
  append_pair(header, sample, tables.pairs);
  tables.original.emplace_back(sample.annotation.original.begin(),
                               sample.annotation.original.end());
  put(tables.projection, sample.labels.projection, row);
  put(tables.projection_source, sample.annotation.projection, row);
  append_flow(sample.flow, header.volume.size, row, tables);
  tables.valid.push_back(sample.valid);
  if (labelled) {
    for (std::size_t i = 0; i < sample.labels.boxes.size(); ++i) {
      const auto& motions = sample.pair.objects;
      append_box(sample.annotation.boxes[i], sample.labels.boxes[i],
                 i < motions.size() ? motions[i] : std::nullopt, tables.boxes);
    }
    for (std::size_t i = 0; i < sample.labels.persons.size(); ++i) {
      append_person(sample.annotation.persons[i], sample.labels.persons[i], tables.poses);
    }
  }
  tables.boxes.offsets.push_back(static_cast<std::int64_t>(tables.boxes.class_id.size()));
  tables.poses.offsets.push_back(static_cast<std::int64_t>(tables.poses.scale.size()));
}

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

std::optional<Rectangle> optional_box(const std::vector<double>& column, std::size_t row) {
  return row_if_any(column, 4, row) == nullptr ? std::nullopt : std::optional(box_at(column, row));
}

std::optional<std::array<double, 12>> projection_if_any(const std::vector<double>& column,
                                                        std::size_t row) {
  const double* number = row_if_any(column, 12, row);
  if (number == nullptr) return std::nullopt;
  std::array<double, 12> projection;
  std::copy_n(number, projection.size(), projection.begin());
  return projection;
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

std::optional<ImageMotion> motion_if_any(const std::vector<double>& column, std::size_t row) {
  const double* number = row_if_any(column, 4, row);
  if (number == nullptr) return std::nullopt;
  return ImageMotion{number[0], number[1], number[2], number[3]};
}

FramePair pair_at(const PairColumns& from, std::size_t row) {
  const auto time_s = [row](const std::vector<double>& column) {
    return column.empty() ? kNan : column[row];
  };
  FramePair pair;
  pair.previous = {from.prev_path[row], from.prev_index[row], from.prev_video_frame[row],
                   time_s(from.prev_time_s)};
  pair.next = {from.next_path[row], from.next_index[row], from.next_video_frame[row],
               time_s(from.next_time_s)};
  pair.gap_frames = from.gap_frames[row];
  pair.label_index = from.label_index[row];
  pair.label_position = from.label_position[row];
  pair.motion = motion_if_any(from.motion, row);
  return pair;
}

FrameOrigin origin_at(const PairColumns& from, std::size_t row) {
  const auto text = [&](const std::vector<std::string>& column) {
    return column.empty() ? std::string() : column[row];
  };
  return {text(from.subject), text(from.action), text(from.camera), text(from.drive)};
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
  if (!from.difficulty.empty()) box.difficulty = from.difficulty[row];
  box.ignore = from.ignore_source[row] != 0;
  return box;
}

/// Empty if there is none, or no outline's text.
Outline outline_at(const BoxColumns& from, std::size_t row) {
  if (from.outline.empty()) return {};
  const std::vector<char>& text = from.outline[row];
  return read_outline({text.data(), text.size()}).value_or(Outline());
}

/// An outline in the volume back in the source, as edges map; empty if the map is not known.
Outline to_source(Outline outline, const std::array<double, 6>& source_to_volume) {
  const double scale_x = source_to_volume[0], scale_y = source_to_volume[4];
  if (!(scale_x > 0 && scale_y > 0)) return {};
  for (auto& ring : outline.rings) {
    for (Point& corner : ring) {
      corner = {(corner.x - 0.5 - source_to_volume[2]) / scale_x + 0.5,
                (corner.y - 0.5 - source_to_volume[5]) / scale_y + 0.5};
    }
  }
  return outline;
}

Person annotated_person(const PoseColumns& from, std::size_t joints, std::size_t row) {
  Person person;
  for (std::size_t j = row * joints; j < (row + 1) * joints; ++j) {
    person.joints.push_back({point_at(from.joints_source, j), from.visible[j]});
  }
  person.center = point_at(from.center_source, row);
  person.scale = from.scale[row];
  person.head_box = box_if_any(from.head_box_source, row);
  person.box = optional_box(from.box_source, row);
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
  person.box = optional_box(from.box, row);
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
  sample.origin = origin_at(tables.pairs, row);
  if (const double* threshold = row_if_any(tables.pairs.threshold, 1, row)) {
    sample.threshold = *threshold;
  }
  sample.pair = pair_at(tables.pairs, row);
  sample.source_size = {tables.pairs.source_size[2 * row], tables.pairs.source_size[2 * row + 1]};
  for (std::size_t i = 0; i < sample.source_to_volume.size(); ++i) {
    sample.source_to_volume[i] = tables.pairs.source_to_volume[6 * row + i];
  }
  sample.statistics = statistics_at(tables.events, row);
  sample.scale = tables.events.scale[row];
  const auto tiles = static_cast<std::ptrdiff_t>(tile_grid(header).pixel_count());
  const auto first_tile = tables.events.tiles.begin() + static_cast<std::ptrdiff_t>(row) * tiles;
  sample.tiles.assign(first_tile, first_tile + tiles);
  sample.annotation.original.assign(tables.original[row].begin(), tables.original[row].end());

  sample.annotation.projection = projection_if_any(tables.projection_source, row);
  sample.labels.projection = projection_if_any(tables.projection, row);
  sample.flow = flow_at(tables, header.volume.size, row);

  const auto rows_of = [row](const std::vector<std::int64_t>& offsets, auto&& each) {
    for (std::int64_t k = offsets[row]; k < offsets[row + 1]; ++k)
      each(static_cast<std::size_t>(k));
  };
  rows_of(tables.boxes.offsets, [&](std::size_t k) {
    const BoxColumns& boxes = tables.boxes;
    sample.annotation.boxes.push_back(annotated_box(boxes, k));
    sample.labels.boxes.push_back({box_at(boxes.xyxy, k), box_at(boxes.xyxy_unclipped, k),
                                   boxes.ignore[k] != 0, outline_at(boxes, k)});
    sample.annotation.boxes.back().outline =
        to_source(sample.labels.boxes.back().outline, sample.source_to_volume);
    if (const auto motion = motion_if_any(boxes.motion, k)) {
      sample.pair.objects.resize(sample.annotation.boxes.size());
      sample.pair.objects.back() = motion;
    }
  });
  if (!sample.pair.objects.empty()) sample.pair.objects.resize(sample.annotation.boxes.size());
  const std::size_t joints = header.label_schema.joint_names.size();
  rows_of(tables.poses.offsets, [&](std::size_t k) {
    sample.annotation.persons.push_back(annotated_person(tables.poses, joints, k));
    sample.labels.persons.push_back(mapped_person(tables.poses, joints, k));
  });
  return sample;
}

}  // namespace eventgan
