#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "manifests/files/input_file.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// A part of a file.
struct ByteRange {
  std::uint64_t offset = 0;
  std::uint32_t length = 0;
};

/// What a COCO file holds, and where: of its images and annotations only what joins them is read.
struct CocoIndex {
  struct Image {
    std::int64_t id = 0;
    ByteRange entry;  ///< from '{' to '}'
    std::string file_name;
    ImageSize size;                    ///< 0 where the entry has no sound one
    bool is_labelled = true;           ///< PoseTrack's `is_labeled`
    std::size_t first_annotation = 0;  ///< in `annotations`; its last is before the next image's
  };
  struct Category {
    std::int64_t id = 0;
    std::string name;
    std::vector<std::string> keypoints;  ///< their names; 0, 1, ... where the file has none
  };
  std::vector<Image> images;           ///< in the file's order, and one without id behind them
  std::vector<ByteRange> annotations;  ///< by image, of each in the file's order
  /// Ascending by id, distinct ids and names; without those whose name an annotated one has.
  std::vector<Category> categories;
  std::size_t compared_boxes = 0;  ///< some of the file's first boxes
  std::size_t boxes_beyond = 0;  ///< of them those that reach beyond their image's right or bottom

  std::size_t crowds = 0;  ///< annotations with `iscrowd` 1 or true

  std::size_t joints_left_out = 0;  ///< annotations with joints that have no names
  bool has_body_parts = false;      ///< COCO-WholeBody's foot_kpts, face_kpts, ... are there

  std::size_t image_count() const { return images.size() - 1; }
};

/// Reads a COCO file once from its begin to its end, in time and memory that grow with its length
/// alone. Throws InputError naming the file (`written`) if it cannot be read, is not JSON, or has
/// no lists `images`, `annotations` and `categories` of entries that each have what joins them
/// (images[].id and file_name, annotations[].image_id, categories[].id and name); if an image, a
/// category or the name of a category with annotations is there twice, or an annotation is of no
/// image: these all counted, and the first twenty named. 2.0 is taken for 2.
///
/// Joints are numbered where no category names any and all annotations have the same number of
/// them. Others' that are not as many as the names are left out.
CocoIndex index_coco(const InputFile& file, const std::string& written);

}  // namespace eventgan
