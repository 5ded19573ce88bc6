#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/frames/own_labels/detail/coco_index.h"

namespace eventgan {

// Entries of a COCO file that was indexed, read strictly; keys that are not needed are passed over.
// 2.0 is taken for 2, and null for a key that may be missing. All throw BadLabel, "PATH (annotation
// 17): $.bbox[2]: expected X, got Y", a line a fault; an id that is another than expected is a
// fault too, since the file has changed then.

/// What an entry of `images` says of the image.
struct CocoImage {
  std::optional<ImageSize> size = {};  ///< scripts leave it out, the image has it
  /// PoseTrack's `ignore_regions_x` and `ignore_regions_y`, the corners of polygons.
  std::vector<std::vector<Point>> ignored = {};
};
CocoImage read_coco_image(const std::string& text, std::int64_t id, const std::string& path);

/// Adds an image's ignored regions behind its objects: boxes to ignore, of the category with joints
/// if there is one, else of the first.
void add_ignored_regions(const CocoImage& entry, ImageSize image, const CocoIndex& index,
                         const std::string& place, Annotation& annotation);

/// What classes and joints a file has: the categories in their order, and the joints that one of
/// them has, with COCO-WholeBody's behind them (left_big_toe, ..., right_face_0 and left_face_0,
/// its mirror image, ..., left_hand_0, ..., right_hand_20). Throws InputError if two have different
/// ones.
LabelSchema coco_schema(const CocoIndex& index, const std::string& path);

/// Adds an entry of `annotations`, a box and perhaps a person, to those of the image; or counts a
/// box that is left out. Its `segmentation` is the outline: polygons, of which those without area
/// are left out, or run lengths of the image's size, plain or compressed; and without `bbox` the
/// outline's bounds are the box. `track_id`, `instance_id` or `attributes.track_id` is the track,
/// unless another object of the image has it (forget_shared_tracks); another value is counted. Not
/// looked at is what no label comes of: num_keypoints, and joints that have no names (CocoIndex).
void add_coco_annotation(const std::string& text, std::int64_t image_id, ImageSize image,
                         const CocoIndex& index, const LabelSchema& schema, const std::string& path,
                         Annotation& annotation);

}  // namespace eventgan
