#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <numeric>
#include <string>
#include <string_view>
#include <utility>
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
  std::vector<std::int8_t> difficulty;     ///< this and the next: empty as long as no box has one
  std::vector<std::vector<char>> outline;  ///< bytes
  std::vector<double> motion;
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

/// Which numbers a sound column of floats has.
enum class Numbers {
  kAny,  ///< a rule of its own (sample_check.cc), or none
  kFinite,
  kFiniteOrNone,     ///< or a row of NaN
  kFiniteOrNoneEach  ///< or NaN in a row's innermost lines, each for itself
};

/// What `source_to_volume` makes of the numbers of a row, in manifests/guides/shard_format.md,
/// "Geometry". Points of (-1, -1) and scales below 0 stay what they are.
enum class Mapped { kNot, kPoints, kEdges, kEdgesIfAny, kScale, kCamera, kProjection };

/// A column: where it is in a shard, its shape [rows, inner...], and the rules for what is in it.
struct ColumnSpec {
  const char* path;
  Rows rows;
  std::vector<std::size_t> inner = {};
  Numbers numbers = Numbers::kAny;
  struct {
    Mapped how = Mapped::kNot;
    const char* source = "";  ///< name of the column of the same group that it is made of
  } mapped = {};
  /// Not in the shard if no row has a value; if there, the shard's `features` have this name. Null:
  /// always there.
  const char* feature = nullptr;
  const char* unit = "";  ///< of an optional column of samples, for people

  /// What stands for "unknown": the numbers of a row, or of each of the row's innermost lines or
  /// elements, as many as these are. None: nothing but NaN, and an empty text.
  std::vector<double> unknown = {};

  ColumnSpec with_unknown(std::vector<double> row) && {
    unknown = std::move(row);
    return std::move(*this);
  }

  bool optional() const { return feature != nullptr; }

  /// The path without its groups, and these with a "/" behind them.
  std::string_view name() const { return std::string_view(path).substr(group().size()); }
  std::string_view group() const {
    return std::string_view(path).substr(0, std::string_view(path).rfind('/') + 1);
  }

  /// Elements a row.
  std::size_t width() const {
    return std::accumulate(inner.begin(), inner.end(), std::size_t{1}, std::multiplies());
  }
};

/// Calls visit(ColumnSpec, column) for every column, offsets before the rows they lead to. Writer,
/// reader, checks and summaries all go through this list, so it is the one place where a shard's
/// columns are described. Tables: ShardTables or const ShardTables.
template <class Tables, class Visit>
void visit_columns(Tables& tables, const ShardHeader& header, Visit&& visit) {
  const std::size_t joints = header.label_schema.joint_names.size();
  const auto rows = static_cast<std::size_t>(tile_grid(header).height);
  const auto columns = static_cast<std::size_t>(tile_grid(header).width);
  using enum Rows;
  using enum Numbers;
  using enum Mapped;

  auto& e = tables.events;
  visit(ColumnSpec{"/events/eta98", kSamples}, e.eta98);
  visit(ColumnSpec{"/events/scale", kSamples}, e.scale);
  visit(ColumnSpec{"/events/statistics/nonzero_fraction", kSamples}, e.nonzero_fraction);
  visit(ColumnSpec{"/events/statistics/sum_positive", kSamples}, e.sum_positive);
  visit(ColumnSpec{"/events/statistics/sum_negative", kSamples}, e.sum_negative);
  visit(ColumnSpec{"/events/statistics/max", kSamples}, e.max);
  visit(ColumnSpec{"/events/statistics/flags", kSamples}, e.flags);
  visit(ColumnSpec{"/events/tiles", kSamples, {rows, columns}, kAny, {}, "tiles"}, e.tiles);
  visit(
      ColumnSpec{
          "/events/statistics/generated_fraction", kSamples, {}, kAny, {}, "tiles", "of its tiles"},
      e.generated_fraction);

  auto& p = tables.pairs;
  visit(ColumnSpec{"/pairs/sample_id", kSamples}, p.sample_id);
  visit(ColumnSpec{"/pairs/dataset", kSamples}, p.dataset);
  visit(ColumnSpec{"/pairs/sequence", kSamples}, p.sequence);
  visit(ColumnSpec{"/pairs/prev_path", kSamples}, p.prev_path);
  visit(ColumnSpec{"/pairs/next_path", kSamples}, p.next_path);
  visit(ColumnSpec{"/pairs/prev_index", kSamples}, p.prev_index);
  visit(ColumnSpec{"/pairs/next_index", kSamples}, p.next_index);
  visit(ColumnSpec{"/pairs/prev_video_frame", kSamples}.with_unknown({-1}), p.prev_video_frame);
  visit(ColumnSpec{"/pairs/next_video_frame", kSamples}.with_unknown({-1}), p.next_video_frame);
  visit(ColumnSpec{"/pairs/gap_frames", kSamples}, p.gap_frames);
  visit(ColumnSpec{"/pairs/gap_s", kSamples}, p.gap_s);
  visit(ColumnSpec{"/pairs/label_index", kSamples}, p.label_index);
  visit(ColumnSpec{"/pairs/label_position", kSamples}, p.label_position);
  visit(ColumnSpec{"/pairs/source_size", kSamples, {2}}, p.source_size);
  visit(ColumnSpec{"/pairs/source_to_volume", kSamples, {2, 3}}, p.source_to_volume);
  visit(ColumnSpec{"/pairs/prev_time_s", kSamples, {}, kAny, {}, "times", "s"}, p.prev_time_s);
  visit(ColumnSpec{"/pairs/next_time_s", kSamples, {}, kAny, {}, "times", "s"}, p.next_time_s);
  visit(ColumnSpec{"/pairs/subject", kSamples, {}, kAny, {}, "origin"}, p.subject);
  visit(ColumnSpec{"/pairs/action", kSamples, {}, kAny, {}, "origin"}, p.action);
  visit(ColumnSpec{"/pairs/camera", kSamples, {}, kAny, {}, "origin"}, p.camera);
  visit(ColumnSpec{"/pairs/drive", kSamples, {}, kAny, {}, "origin"}, p.drive);
  visit(
      ColumnSpec{
          "/pairs/motion", kSamples, {4}, kFiniteOrNone, {}, "motion", "px, px, degrees, factor"},
      p.motion);
  visit(ColumnSpec{"/pairs/threshold", kSamples, {}, kAny, {}, "threshold", "of the log intensity"},
        p.threshold);

  visit(ColumnSpec{"/labels/original", kSamples}, tables.original);
  visit(ColumnSpec{"/labels/projection",
                   kSamples,
                   {3, 4},
                   kFiniteOrNone,
                   {kProjection, "projection_source"},
                   "projection"},
        tables.projection);
  visit(ColumnSpec{"/labels/projection_source", kSamples, {3, 4}, kFiniteOrNone, {}, "projection"},
        tables.projection_source);

  auto& b = tables.boxes;
  visit(ColumnSpec{"/labels/boxes/offsets", kOffsets}, b.offsets);
  visit(ColumnSpec{"/labels/boxes/xyxy", kBoxes, {4}, kFinite}, b.xyxy);
  visit(ColumnSpec{"/labels/boxes/xyxy_unclipped", kBoxes, {4}, kFinite, {kEdges, "xyxy_source"}},
        b.xyxy_unclipped);
  visit(ColumnSpec{"/labels/boxes/xyxy_source", kBoxes, {4}, kFinite}, b.xyxy_source);
  visit(ColumnSpec{"/labels/boxes/class_id", kBoxes}, b.class_id);
  visit(ColumnSpec{"/labels/boxes/truncation", kBoxes, {}, kFinite}.with_unknown({-1}),
        b.truncation);
  visit(ColumnSpec{"/labels/boxes/occlusion", kBoxes}.with_unknown({-1}), b.occlusion);
  visit(ColumnSpec{"/labels/boxes/alpha", kBoxes, {}, kFinite}.with_unknown({-10}), b.alpha);
  visit(ColumnSpec{"/labels/boxes/box3d", kBoxes, {7}, kFinite}.with_unknown(
            {-1, -1, -1, -1000, -1000, -1000, -10}),
        b.box3d);
  visit(ColumnSpec{"/labels/boxes/ignore", kBoxes}, b.ignore);
  visit(ColumnSpec{"/labels/boxes/ignore_source", kBoxes}, b.ignore_source);
  visit(ColumnSpec{"/labels/boxes/track_id", kBoxes}.with_unknown({-1}), b.track_id);
  visit(
      ColumnSpec{"/labels/boxes/difficulty", kBoxes, {}, kAny, {}, "difficulty"}.with_unknown({-1}),
      b.difficulty);
  visit(ColumnSpec{"/labels/boxes/outline", kBoxes, {}, kAny, {}, "outlines"}, b.outline);
  visit(ColumnSpec{"/labels/boxes/motion", kBoxes, {4}, kFiniteOrNone, {}, "object_motion"},
        b.motion);

  auto& h = tables.poses;
  visit(ColumnSpec{"/labels/poses/offsets", kOffsets}, h.offsets);
  visit(
      ColumnSpec{"/labels/poses/joints", kPersons, {joints, 2}, kFinite, {kPoints, "joints_source"}}
          .with_unknown({-1, -1}),
      h.joints);
  visit(ColumnSpec{"/labels/poses/joints_source", kPersons, {joints, 2}, kFinite}.with_unknown(
            {-1, -1}),
        h.joints_source);
  visit(ColumnSpec{"/labels/poses/visible", kPersons, {joints}}.with_unknown({-1}), h.visible);
  visit(ColumnSpec{"/labels/poses/center", kPersons, {2}, kFinite, {kPoints, "center_source"}}
            .with_unknown({-1, -1}),
        h.center);
  visit(ColumnSpec{"/labels/poses/center_source", kPersons, {2}, kFinite}.with_unknown({-1, -1}),
        h.center_source);
  visit(ColumnSpec{"/labels/poses/scale", kPersons, {}, kFinite}.with_unknown({-1}), h.scale);
  visit(ColumnSpec{"/labels/poses/scale_volume", kPersons, {}, kFinite, {kScale, "scale"}}
            .with_unknown({-1}),
        h.scale_volume);
  visit(
      ColumnSpec{"/labels/poses/head_box", kPersons, {4}, kFinite, {kEdgesIfAny, "head_box_source"}}
          .with_unknown({-1, -1, -1, -1}),
      h.head_box);
  visit(ColumnSpec{"/labels/poses/head_box_source", kPersons, {4}, kFinite}.with_unknown(
            {-1, -1, -1, -1}),
        h.head_box_source);
  visit(ColumnSpec{"/labels/poses/box",
                   kPersons,
                   {4},
                   kFiniteOrNone,
                   {kEdges, "box_source"},
                   "person_boxes"},
        h.box);
  visit(ColumnSpec{"/labels/poses/box_source", kPersons, {4}, kFiniteOrNone, {}, "person_boxes"},
        h.box_source);
  visit(
      ColumnSpec{
          "/labels/poses/joints3d_mm", kPersons, {joints, 3}, kFiniteOrNoneEach, {}, "joints3d"},
      h.joints3d_mm);
  visit(ColumnSpec{"/labels/poses/camera",
                   kPersons,
                   {4},
                   kFiniteOrNone,
                   {kCamera, "camera_source"},
                   "camera"},
        h.camera);
  visit(ColumnSpec{"/labels/poses/camera_source", kPersons, {4}, kFiniteOrNone, {}, "camera"},
        h.camera_source);
  visit(ColumnSpec{"/labels/poses/camera_distortion", kPersons, {5}, kFiniteOrNone, {}, "camera"},
        h.camera_distortion);

  visit(ColumnSpec{"/valid", kSamples}, tables.valid);
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
