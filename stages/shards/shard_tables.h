#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <numeric>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/half.h"
#include "manifests/values/labels.h"
#include "manifests/values/shard.h"

namespace eventgan {

// Everything in a shard but the volumes, column by column: a member for each dataset, of the same
// name and element type; arrays with inner dimensions are flat, in C order. visit_columns says
// which is where and what each means.

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
  std::vector<Half> flow;                             ///< this and the next likewise
  std::vector<std::uint8_t> flow_valid;
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
enum class SoundNumbers {
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
  const char* meaning;  ///< Markdown for the table of manifests/guides/shard_format.md
  Rows rows;
  std::vector<std::size_t> inner = {};
  SoundNumbers numbers = SoundNumbers::kAny;
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

  /// A row is an image: it is a chunk of its own, and an array where other values are JSON.
  bool is_image = false;

  ColumnSpec with_unknown(std::vector<double> row) && {
    unknown = std::move(row);
    return std::move(*this);
  }

  ColumnSpec as_image() && {
    is_image = true;
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
  const auto height = static_cast<std::size_t>(header.volume.size.height);
  const auto width = static_cast<std::size_t>(header.volume.size.width);
  using enum Rows;
  using enum SoundNumbers;
  using enum Mapped;

  auto& e = tables.events;
  visit(ColumnSpec{"/events/eta98", "98th percentile of the non-zero values as generated; 0: none",
                   kSamples},
        e.eta98);
  visit(ColumnSpec{"/events/scale", "Value = stored number x scale; 1 unless the volume is uint8",
                   kSamples},
        e.scale);
  visit(ColumnSpec{"/events/statistics/nonzero_fraction",
                   "Share of values as generated that are not 0", kSamples},
        e.nonzero_fraction);
  visit(ColumnSpec{"/events/statistics/sum_positive", "Sum of the positive channels as generated",
                   kSamples},
        e.sum_positive);
  visit(ColumnSpec{"/events/statistics/sum_negative", "Sum of the negative channels as generated",
                   kSamples},
        e.sum_negative);
  visit(ColumnSpec{"/events/statistics/max", "Largest value as generated", kSamples}, e.max);
  visit(ColumnSpec{"/events/statistics/flags", "Bits ([Flags](#flags))", kSamples}, e.flags);
  visit(ColumnSpec{"/events/tiles",
                   "1: generated; 0: left at zero, but for noise",
                   kSamples,
                   {rows, columns},
                   kAny,
                   {},
                   "tiles"},
        e.tiles);
  visit(ColumnSpec{"/events/statistics/generated_fraction",
                   "Share of tiles generated",
                   kSamples,
                   {},
                   kAny,
                   {},
                   "tiles",
                   "of its tiles"},
        e.generated_fraction);

  auto& p = tables.pairs;
  visit(ColumnSpec{"/pairs/sample_id", "The sample's name, unique in its source", kSamples},
        p.sample_id);
  visit(ColumnSpec{"/pairs/dataset", "Kind of source, as in the manifest", kSamples}, p.dataset);
  visit(ColumnSpec{"/pairs/sequence", "Recording of both frames", kSamples}, p.sequence);
  visit(
      ColumnSpec{
          "/pairs/prev_path",
          "Previous frame's file: the source's root as in the manifest, then the path below it",
          kSamples},
      p.prev_path);
  visit(ColumnSpec{"/pairs/next_path", "Next frame's file", kSamples}, p.next_path);
  visit(ColumnSpec{"/pairs/prev_index", "Previous frame's number, as the dataset counts", kSamples},
        p.prev_index);
  visit(ColumnSpec{"/pairs/next_index", "Next frame's", kSamples}, p.next_index);
  visit(ColumnSpec{"/pairs/prev_video_frame",
                   "Previous frame's position in the video or recording, from 0; -1: an image",
                   kSamples}
            .with_unknown({-1}),
        p.prev_video_frame);
  visit(ColumnSpec{"/pairs/next_video_frame", "Next frame's", kSamples}.with_unknown({-1}),
        p.next_video_frame);
  visit(
      ColumnSpec{"/pairs/gap_frames",
                 "Frames from previous to next, 1..6; 0: a window of a camera's events", kSamples},
      p.gap_frames);
  visit(ColumnSpec{"/pairs/gap_s", "Seconds from previous to next; NaN: unknown", kSamples},
        p.gap_s);
  visit(ColumnSpec{"/pairs/label_index", "Labelled frame's number", kSamples}, p.label_index);
  visit(ColumnSpec{"/pairs/label_position",
                   "Where the labelled frame lies: 0 previous, 1 next, 0.5 half-way (within 0.01), "
                   "else by times",
                   kSamples},
        p.label_position);
  visit(ColumnSpec{"/pairs/source_size",
                   "Height and width of the source image; 0: unreadable",
                   kSamples,
                   {2}},
        p.source_size);
  visit(ColumnSpec{"/pairs/source_to_volume",
                   "M in [x', y'] = M [x, y, 1] ([Geometry](#geometry)); NaN: image unreadable",
                   kSamples,
                   {2, 3}},
        p.source_to_volume);
  visit(ColumnSpec{"/pairs/prev_time_s",
                   "Previous frame's time on its sequence's clock; NaN: unknown",
                   kSamples,
                   {},
                   kAny,
                   {},
                   "times",
                   "s"},
        p.prev_time_s);
  visit(ColumnSpec{"/pairs/next_time_s", "Next frame's", kSamples, {}, kAny, {}, "times", "s"},
        p.next_time_s);
  visit(
      ColumnSpec{
          "/pairs/subject", "Human3.6M's `S1`; empty: none", kSamples, {}, kAny, {}, "origin"},
      p.subject);
  visit(
      ColumnSpec{"/pairs/action", "`Directions-1`; empty: none", kSamples, {}, kAny, {}, "origin"},
      p.action);
  visit(ColumnSpec{"/pairs/camera", "`54138969`; empty: none", kSamples, {}, kAny, {}, "origin"},
        p.camera);
  visit(ColumnSpec{"/pairs/drive",
                   "KITTI's drive, or sequence of tracking; empty: none",
                   kSamples,
                   {},
                   kAny,
                   {},
                   "origin"},
        p.drive);
  visit(ColumnSpec{"/pairs/motion",
                   "Of stills, previous to next: x and y in source pixels, angle in degrees, scale "
                   "([Geometry](#geometry)); NaN: frames of a sequence",
                   kSamples,
                   {4},
                   kFiniteOrNone,
                   {},
                   "motion",
                   "px, px, degrees, factor"},
        p.motion);
  visit(ColumnSpec{"/pairs/threshold",
                   "Contrast threshold drawn by `sensor.threshold`, natural log; NaN: no volume",
                   kSamples,
                   {},
                   kAny,
                   {},
                   "threshold",
                   "of the log intensity"},
        p.threshold);

  visit(ColumnSpec{"/labels/original",
                   "Annotation as in the dataset: a text's bytes, or an entry (.mat, .h5, .npz) as "
                   "JSON; of index masks name, SHA-256 and numbers",
                   kSamples},
        tables.original);
  visit(ColumnSpec{"/labels/projection",
                   "P' in w [x', y', 1] = P' [X, Y, Z, 1]: X in m, rectified frame of KITTI's "
                   "camera 0; NaN: no calibration",
                   kSamples,
                   {3, 4},
                   kFiniteOrNone,
                   {kProjection, "projection_source"},
                   "projection"},
        tables.projection);
  visit(ColumnSpec{"/labels/projection_source",
                   "KITTI's P2 (raw: P_rect_02)",
                   kSamples,
                   {3, 4},
                   kFiniteOrNone,
                   {},
                   "projection"},
        tables.projection_source);
  visit(
      ColumnSpec{
          "/labels/flow",
          "x, y: motion, previous to next, of what the labelled image shows there; 0 beyond it "
          "or unknown; NaN: none",
          kSamples,
          {2, height, width},
          kAny,
          {},
          "flow"}
          .as_image(),
      tables.flow);
  visit(ColumnSpec{"/labels/flow_valid",
                   "1: seen in both images; else 0",
                   kSamples,
                   {height, width},
                   kAny,
                   {},
                   "flow"}
            .as_image(),
        tables.flow_valid);

  auto& b = tables.boxes;
  visit(ColumnSpec{"/labels/boxes/offsets", "First row of each sample, then R", kOffsets},
        b.offsets);
  visit(ColumnSpec{"/labels/boxes/xyxy",
                   "Left, top, right, bottom, cut to what the volume shows of the image",
                   kBoxes,
                   {4},
                   kFinite},
        b.xyxy);
  visit(ColumnSpec{"/labels/boxes/xyxy_unclipped",
                   "Before the cut",
                   kBoxes,
                   {4},
                   kFinite,
                   {kEdges, "xyxy_source"}},
        b.xyxy_unclipped);
  visit(ColumnSpec{"/labels/boxes/xyxy_source", "As annotated", kBoxes, {4}, kFinite},
        b.xyxy_source);
  visit(ColumnSpec{"/labels/boxes/class_id", "Index into `class_names`", kBoxes}, b.class_id);
  visit(ColumnSpec{"/labels/boxes/truncation",
                   "0 whole .. 1 outside the image; -1 unknown; `kitti_tracking`: level 0, 1, 2 "
                   "(to be ignored)",
                   kBoxes,
                   {},
                   kFinite}
            .with_unknown({-1}),
        b.truncation);
  visit(ColumnSpec{"/labels/boxes/occlusion",
                   "0 visible, 1 partly, 2 largely occluded, 3 unknown; -1 not annotated", kBoxes}
            .with_unknown({-1}),
        b.occlusion);
  visit(
      ColumnSpec{
          "/labels/boxes/alpha", "Observation angle, rad, -π..π; -10 unknown", kBoxes, {}, kFinite}
          .with_unknown({-10}),
      b.alpha);
  visit(ColumnSpec{"/labels/boxes/box3d",
                   "Height, width, length, x, y, z (m, camera's frame), rotation_y (rad); unknown: "
                   "-1 -1 -1 -1000 -1000 -1000 -10",
                   kBoxes,
                   {7},
                   kFinite}
            .with_unknown({-1, -1, -1, -1000, -1000, -1000, -10}),
        b.box3d);
  visit(ColumnSpec{"/labels/boxes/ignore",
                   "1: leave out of training and scoring: annotated so, or nothing of box or "
                   "outline is in the volume",
                   kBoxes},
        b.ignore);
  visit(ColumnSpec{"/labels/boxes/ignore_source", "1: annotated so", kBoxes}, b.ignore_source);
  visit(ColumnSpec{"/labels/boxes/track_id", "The object's number in its sequence; -1 none", kBoxes}
            .with_unknown({-1}),
        b.track_id);
  visit(ColumnSpec{"/labels/boxes/difficulty",
                   "KITTI object's: 0 easy (height ≥ 40 source pixels, visible, truncation ≤ "
                   "0.15), 1 moderate (≥ 25, partly occluded, ≤ 0.30), 2 hard (≥ 25, largely, ≤ "
                   "0.50); `recording`: 0 or 2; -1 none",
                   kBoxes,
                   {},
                   kAny,
                   {},
                   "difficulty"}
            .with_unknown({-1}),
        b.difficulty);
  visit(ColumnSpec{"/labels/boxes/outline",
                   "[Outline](#outlines), not cut: JSON `[[x,y,x,y,...],...]`, float32 in decimal "
                   "digits; empty: none",
                   kBoxes,
                   {},
                   kAny,
                   {},
                   "outlines"},
        b.outline);
  visit(ColumnSpec{"/labels/boxes/motion",
                   "Of stills' objects, before `/pairs/motion` is added, about the centre of "
                   "`xyxy_source`; 0, 0, 0, 1: as the image; NaN: part of the image",
                   kBoxes,
                   {4},
                   kFiniteOrNone,
                   {},
                   "object_motion"},
        b.motion);

  auto& h = tables.poses;
  visit(ColumnSpec{"/labels/poses/offsets", "First row of each sample, then P", kOffsets},
        h.offsets);
  visit(ColumnSpec{"/labels/poses/joints",
                   "x, y",
                   kPersons,
                   {joints, 2},
                   kFinite,
                   {kPoints, "joints_source"}}
            .with_unknown({-1, -1}),
        h.joints);
  visit(ColumnSpec{"/labels/poses/joints_source",
                   "As annotated, from 0, in the image of `source_size`",
                   kPersons,
                   {joints, 2},
                   kFinite}
            .with_unknown({-1, -1}),
        h.joints_source);
  visit(ColumnSpec{"/labels/poses/visible",
                   "1 visible; 0 hidden or not annotated; -1 annotated, visibility unknown",
                   kPersons,
                   {joints}}
            .with_unknown({-1}),
        h.visible);
  visit(
      ColumnSpec{"/labels/poses/center", "x, y", kPersons, {2}, kFinite, {kPoints, "center_source"}}
          .with_unknown({-1, -1}),
      h.center);
  visit(ColumnSpec{"/labels/poses/center_source", "As annotated", kPersons, {2}, kFinite}
            .with_unknown({-1, -1}),
        h.center_source);
  visit(ColumnSpec{"/labels/poses/scale",
                   "As annotated (MPII: height / 200 source pixels)",
                   kPersons,
                   {},
                   kFinite}
            .with_unknown({-1}),
        h.scale);
  visit(ColumnSpec{"/labels/poses/scale_volume",
                   "scale x √(s_x s_y)",
                   kPersons,
                   {},
                   kFinite,
                   {kScale, "scale"}}
            .with_unknown({-1}),
        h.scale_volume);
  visit(ColumnSpec{"/labels/poses/head_box",
                   "Left, top, right, bottom, not cut",
                   kPersons,
                   {4},
                   kFinite,
                   {kEdgesIfAny, "head_box_source"}}
            .with_unknown({-1, -1, -1, -1}),
        h.head_box);
  visit(ColumnSpec{"/labels/poses/head_box_source", "As annotated", kPersons, {4}, kFinite}
            .with_unknown({-1, -1, -1, -1}),
        h.head_box_source);
  visit(ColumnSpec{"/labels/poses/box",
                   "Around all annotated joints (Human3.6M), not cut",
                   kPersons,
                   {4},
                   kFiniteOrNone,
                   {kEdges, "box_source"},
                   "person_boxes"},
        h.box);
  visit(
      ColumnSpec{
          "/labels/poses/box_source", "The same", kPersons, {4}, kFiniteOrNone, {}, "person_boxes"},
      h.box_source);
  visit(ColumnSpec{"/labels/poses/joints3d_mm",
                   "x, y, z in the camera's frame",
                   kPersons,
                   {joints, 3},
                   kFiniteOrNoneEach,
                   {},
                   "joints3d"},
        h.joints3d_mm);
  visit(ColumnSpec{"/labels/poses/camera",
                   "f_x, f_y, c_x, c_y: u = f_x X/Z + c_x",
                   kPersons,
                   {4},
                   kFiniteOrNone,
                   {kCamera, "camera_source"},
                   "camera"},
        h.camera);
  visit(ColumnSpec{"/labels/poses/camera_source",
                   "The same, where `camera` is",
                   kPersons,
                   {4},
                   kFiniteOrNone,
                   {},
                   "camera"},
        h.camera_source);
  visit(ColumnSpec{"/labels/poses/camera_distortion",
                   "k1, k2, k3, p1, p2 ([Geometry](#geometry))",
                   kPersons,
                   {5},
                   kFiniteOrNone,
                   {},
                   "camera"},
        h.camera_distortion);

  visit(ColumnSpec{"/valid",
                   "1: valid; 0: quarantined, as the commit record says why; volume and statistics "
                   "are 0, labels may be missing",
                   kSamples},
        tables.valid);
}

/// The volumes' column, which visit_columns leaves out.
ColumnSpec volume_column(const VolumeShape& volume);

/// Counts the rows of consistent tables; a box whose class has no name is of no class.
ShardContents contents_of(const ShardTables& tables, const ShardHeader& header);

/// Names of what not every shard has, and one with these columns (paths) and names of joints has:
/// the columns' features and "joint_aliases". Each once, in the order of the columns.
std::vector<std::string> features_of(const std::vector<std::string>& optional_columns,
                                     const LabelSchema& schema);

/// Those of `features` that this program does not know.
std::vector<std::string> unknown_features(const std::vector<std::string>& features);

}  // namespace eventgan
