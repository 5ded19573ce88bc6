#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "manifests/values/labels.h"
#include "manifests/values/shard.h"

namespace eventgan {

// Everything in a shard but the volumes, column by column: a member for each dataset, of the same
// name and element type; arrays with inner dimensions are flat, in C order. visit_columns says
// which is where; manifests/guides/shard_format.md says what each means.

/// `/events/*`, one row a sample.
struct EventColumns {
  std::vector<float> eta98, scale;
  std::vector<float> nonzero_fraction, max;
  std::vector<double> sum_positive, sum_negative;
  std::vector<std::uint32_t> flags;
  std::vector<std::uint8_t> tiles;  ///< this and the next: empty if whole volumes are generated
  std::vector<float> generated_fraction;
};

/// `/pairs/*`, one row a sample. The last four lines are empty as long as no sample has such a
/// thing.
struct PairColumns {
  std::vector<std::string> sample_id, dataset, sequence;
  std::vector<std::string> prev_path, next_path;
  std::vector<std::int64_t> prev_index, next_index;
  std::vector<std::int64_t> prev_video_frame, next_video_frame;
  std::vector<std::int32_t> gap_frames;
  std::vector<double> gap_s;
  std::vector<std::int64_t> label_index;
  std::vector<double> label_position;
  std::vector<std::int32_t> source_size;
  std::vector<double> source_to_volume;
  std::vector<double> prev_time_s, next_time_s;
  std::vector<std::string> subject, action, camera, drive;
  std::vector<double> motion;
  std::vector<double> threshold;
};

/// `/labels/boxes/*`, rows offsets[i] to offsets[i + 1] for sample i.
struct BoxColumns {
  std::vector<std::int64_t> offsets{0};
  std::vector<double> xyxy, xyxy_unclipped, xyxy_source;
  std::vector<std::int32_t> class_id;
  std::vector<float> truncation;
  std::vector<std::int32_t> occlusion;
  std::vector<float> alpha, box3d;
  std::vector<std::uint8_t> ignore, ignore_source;
  std::vector<std::int64_t> track_id;
  std::vector<std::int8_t> difficulty;  ///< empty as long as no box has one
};

/// `/labels/poses/*`, rows offsets[i] to offsets[i + 1] for sample i. The last two lines are empty
/// as long as no person has such a thing.
struct PoseColumns {
  std::vector<std::int64_t> offsets{0};
  std::vector<double> joints, joints_source;
  std::vector<std::int8_t> visible;
  std::vector<double> center, center_source;
  std::vector<double> scale, scale_volume;
  std::vector<double> head_box, head_box_source;
  std::vector<double> box, box_source;
  std::vector<double> joints3d_mm, camera, camera_source, camera_distortion;
};

struct ShardTables {
  EventColumns events;
  PairColumns pairs;
  std::vector<std::vector<char>> original;            ///< bytes
  std::vector<double> projection, projection_source;  ///< empty as long as no sample has one
  BoxColumns boxes;
  PoseColumns poses;
  std::vector<std::uint8_t> valid;
};

/// Rows and columns of ShardSample::tiles; {0, 0} if there are none.
ImageSize tile_grid(const ShardHeader& header);

/// Share of a sample's tiles that are generated, 0..1; 1 if it has none.
double generated_fraction(const ShardSample& sample);

/// What a column has one row for. kOffsets: one more row than samples.
enum class Rows { kSamples, kOffsets, kBoxes, kPersons };

/// Where a column is in a shard, and its shape [rows, inner...].
struct ColumnSpec {
  const char* path;
  Rows rows;
  std::vector<std::size_t> inner;
  /// Not in the shard if no row has a value; if there, the shard's `features` have this name. Null:
  /// always there.
  const char* feature = nullptr;

  bool optional() const { return feature != nullptr; }
};

/// Calls visit(ColumnSpec, column) for every column, offsets before the rows they lead to. Writer,
/// reader and check all go through this list, so it is the one place where the layout of a shard
/// is in the code. Tables: ShardTables or const ShardTables.
template <class Tables, class Visit>
void visit_columns(Tables& tables, const ShardHeader& header, Visit&& visit) {
  const std::size_t joints = header.label_schema.joint_names.size();
  const ImageSize grid = tile_grid(header);
  auto& e = tables.events;
  visit(ColumnSpec{"/events/eta98", Rows::kSamples, {}}, e.eta98);
  visit(ColumnSpec{"/events/scale", Rows::kSamples, {}}, e.scale);
  visit(ColumnSpec{"/events/statistics/nonzero_fraction", Rows::kSamples, {}}, e.nonzero_fraction);
  visit(ColumnSpec{"/events/statistics/sum_positive", Rows::kSamples, {}}, e.sum_positive);
  visit(ColumnSpec{"/events/statistics/sum_negative", Rows::kSamples, {}}, e.sum_negative);
  visit(ColumnSpec{"/events/statistics/max", Rows::kSamples, {}}, e.max);
  visit(ColumnSpec{"/events/statistics/flags", Rows::kSamples, {}}, e.flags);
  visit(ColumnSpec{"/events/tiles",
                   Rows::kSamples,
                   {static_cast<std::size_t>(grid.height), static_cast<std::size_t>(grid.width)},
                   "tiles"},
        e.tiles);
  visit(ColumnSpec{"/events/statistics/generated_fraction", Rows::kSamples, {}, "tiles"},
        e.generated_fraction);

  auto& p = tables.pairs;
  visit(ColumnSpec{"/pairs/sample_id", Rows::kSamples, {}}, p.sample_id);
  visit(ColumnSpec{"/pairs/dataset", Rows::kSamples, {}}, p.dataset);
  visit(ColumnSpec{"/pairs/sequence", Rows::kSamples, {}}, p.sequence);
  visit(ColumnSpec{"/pairs/prev_path", Rows::kSamples, {}}, p.prev_path);
  visit(ColumnSpec{"/pairs/next_path", Rows::kSamples, {}}, p.next_path);
  visit(ColumnSpec{"/pairs/prev_index", Rows::kSamples, {}}, p.prev_index);
  visit(ColumnSpec{"/pairs/next_index", Rows::kSamples, {}}, p.next_index);
  visit(ColumnSpec{"/pairs/prev_video_frame", Rows::kSamples, {}}, p.prev_video_frame);
  visit(ColumnSpec{"/pairs/next_video_frame", Rows::kSamples, {}}, p.next_video_frame);
  visit(ColumnSpec{"/pairs/gap_frames", Rows::kSamples, {}}, p.gap_frames);
  visit(ColumnSpec{"/pairs/gap_s", Rows::kSamples, {}}, p.gap_s);
  visit(ColumnSpec{"/pairs/label_index", Rows::kSamples, {}}, p.label_index);
  visit(ColumnSpec{"/pairs/label_position", Rows::kSamples, {}}, p.label_position);
  visit(ColumnSpec{"/pairs/source_size", Rows::kSamples, {2}}, p.source_size);
  visit(ColumnSpec{"/pairs/source_to_volume", Rows::kSamples, {2, 3}}, p.source_to_volume);
  visit(ColumnSpec{"/pairs/prev_time_s", Rows::kSamples, {}, "times"}, p.prev_time_s);
  visit(ColumnSpec{"/pairs/next_time_s", Rows::kSamples, {}, "times"}, p.next_time_s);
  visit(ColumnSpec{"/pairs/subject", Rows::kSamples, {}, "origin"}, p.subject);
  visit(ColumnSpec{"/pairs/action", Rows::kSamples, {}, "origin"}, p.action);
  visit(ColumnSpec{"/pairs/camera", Rows::kSamples, {}, "origin"}, p.camera);
  visit(ColumnSpec{"/pairs/drive", Rows::kSamples, {}, "origin"}, p.drive);
  visit(ColumnSpec{"/pairs/motion", Rows::kSamples, {4}, "motion"}, p.motion);
  visit(ColumnSpec{"/pairs/threshold", Rows::kSamples, {}, "threshold"}, p.threshold);

  visit(ColumnSpec{"/labels/original", Rows::kSamples, {}}, tables.original);
  visit(ColumnSpec{"/labels/projection", Rows::kSamples, {3, 4}, "projection"}, tables.projection);
  visit(ColumnSpec{"/labels/projection_source", Rows::kSamples, {3, 4}, "projection"},
        tables.projection_source);

  auto& b = tables.boxes;
  visit(ColumnSpec{"/labels/boxes/offsets", Rows::kOffsets, {}}, b.offsets);
  visit(ColumnSpec{"/labels/boxes/xyxy", Rows::kBoxes, {4}}, b.xyxy);
  visit(ColumnSpec{"/labels/boxes/xyxy_unclipped", Rows::kBoxes, {4}}, b.xyxy_unclipped);
  visit(ColumnSpec{"/labels/boxes/xyxy_source", Rows::kBoxes, {4}}, b.xyxy_source);
  visit(ColumnSpec{"/labels/boxes/class_id", Rows::kBoxes, {}}, b.class_id);
  visit(ColumnSpec{"/labels/boxes/truncation", Rows::kBoxes, {}}, b.truncation);
  visit(ColumnSpec{"/labels/boxes/occlusion", Rows::kBoxes, {}}, b.occlusion);
  visit(ColumnSpec{"/labels/boxes/alpha", Rows::kBoxes, {}}, b.alpha);
  visit(ColumnSpec{"/labels/boxes/box3d", Rows::kBoxes, {7}}, b.box3d);
  visit(ColumnSpec{"/labels/boxes/ignore", Rows::kBoxes, {}}, b.ignore);
  visit(ColumnSpec{"/labels/boxes/ignore_source", Rows::kBoxes, {}}, b.ignore_source);
  visit(ColumnSpec{"/labels/boxes/track_id", Rows::kBoxes, {}}, b.track_id);
  visit(ColumnSpec{"/labels/boxes/difficulty", Rows::kBoxes, {}, "difficulty"}, b.difficulty);

  auto& h = tables.poses;
  visit(ColumnSpec{"/labels/poses/offsets", Rows::kOffsets, {}}, h.offsets);
  visit(ColumnSpec{"/labels/poses/joints", Rows::kPersons, {joints, 2}}, h.joints);
  visit(ColumnSpec{"/labels/poses/joints_source", Rows::kPersons, {joints, 2}}, h.joints_source);
  visit(ColumnSpec{"/labels/poses/visible", Rows::kPersons, {joints}}, h.visible);
  visit(ColumnSpec{"/labels/poses/center", Rows::kPersons, {2}}, h.center);
  visit(ColumnSpec{"/labels/poses/center_source", Rows::kPersons, {2}}, h.center_source);
  visit(ColumnSpec{"/labels/poses/scale", Rows::kPersons, {}}, h.scale);
  visit(ColumnSpec{"/labels/poses/scale_volume", Rows::kPersons, {}}, h.scale_volume);
  visit(ColumnSpec{"/labels/poses/head_box", Rows::kPersons, {4}}, h.head_box);
  visit(ColumnSpec{"/labels/poses/head_box_source", Rows::kPersons, {4}}, h.head_box_source);
  visit(ColumnSpec{"/labels/poses/box", Rows::kPersons, {4}, "person_boxes"}, h.box);
  visit(ColumnSpec{"/labels/poses/box_source", Rows::kPersons, {4}, "person_boxes"}, h.box_source);
  visit(ColumnSpec{"/labels/poses/joints3d_mm", Rows::kPersons, {joints, 3}, "joints3d"},
        h.joints3d_mm);
  visit(ColumnSpec{"/labels/poses/camera", Rows::kPersons, {4}, "camera"}, h.camera);
  visit(ColumnSpec{"/labels/poses/camera_source", Rows::kPersons, {4}, "camera"}, h.camera_source);
  visit(ColumnSpec{"/labels/poses/camera_distortion", Rows::kPersons, {5}, "camera"},
        h.camera_distortion);

  visit(ColumnSpec{"/valid", Rows::kSamples, {}}, tables.valid);
}

/// Counts the rows of consistent tables; a box whose class has no name is of no class.
ShardContents contents_of(const ShardTables& tables, const ShardHeader& header);

/// Names of what not every shard has, and one with these columns (paths) and names of joints has:
/// the columns' features and "joint_aliases". Each once, in the order of the columns.
std::vector<std::string> features_of(const std::vector<std::string>& optional_columns,
                                     const LabelSchema& schema);

/// Those of `features` that this program does not know.
std::vector<std::string> unknown_features(const std::vector<std::string>& features);

}  // namespace eventgan
