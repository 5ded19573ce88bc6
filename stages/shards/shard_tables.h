#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace eventgan {

// Everything in a shard but the volumes, column by column: a member for each dataset, of the same
// name and element type; arrays with inner dimensions are flat, in C order. shard_columns.h says
// which is where; manifests/guides/shard_format.md says what each means.

/// `/events/*`, one row a sample.
struct EventColumns {
  std::vector<float> eta98, scale;
  std::vector<float> nonzero_fraction, max;
  std::vector<double> sum_positive, sum_negative;
  std::vector<std::uint32_t> flags;
};

/// `/pairs/*`, one row a sample.
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
};

/// `/labels/poses/*`, rows offsets[i] to offsets[i + 1] for sample i. The last four are empty as
/// long as no person has such a thing.
struct PoseColumns {
  std::vector<std::int64_t> offsets{0};
  std::vector<double> joints, joints_source;
  std::vector<std::int8_t> visible;
  std::vector<double> center, center_source;
  std::vector<double> scale, scale_volume;
  std::vector<double> head_box, head_box_source;
  std::vector<double> joints3d_mm, camera, camera_source, camera_distortion;
};

struct ShardTables {
  EventColumns events;
  PairColumns pairs;
  std::vector<std::vector<char>> original;  ///< bytes
  BoxColumns boxes;
  PoseColumns poses;
  std::vector<std::uint8_t> valid;
};

}  // namespace eventgan
