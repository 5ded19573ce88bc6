#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/base/images/image_file.h"

namespace eventgan {

/// A mask of more objects is none.
inline constexpr std::size_t kMostMaskObjects = 1000;

/// A mask in which each pixel has the number of its object, as Pascal VOC, DAVIS and Penn-Fudan
/// have them: a PNG, grey or with a palette, whose colours say nothing. 0 is background. In masks
/// of 8 bits 255 is void, of no object; but in a grey one that has no other number, as masks of a
/// single object have, it is object 1. A value; reading it from several threads is safe.
class IndexMask {
 public:
  /// A fault names the file as `written`, and is one of a mask of too many objects, or of
  /// corners of their outlines, too.
  static Outcome<IndexMask> read(const std::filesystem::path& file, const std::string& written);

  ImageSize size() const { return image_.size; }
  int bits() const { return image_.bits; }
  bool has_palette() const { return image_.has_palette; }
  /// Those of objects, ascending.
  const std::vector<int>& indices() const { return indices_; }
  /// One object, white (255) on black.
  bool is_white() const { return is_white_; }
  /// The edges of the object's pixels.
  Outline outline(int index) const;
  /// Which share of the object's pixels has its centre in the area.
  double share_in(int index, const Rectangle& area) const;

 private:
  explicit IndexMask(IndexImage image);

  struct Extent {  ///< of an object's pixels: first and last row and column
    int top, bottom, left, right;
  };

  const Extent& extent(int index) const;

  IndexImage image_;
  bool is_white_ = false;
  std::vector<int> indices_;
  std::vector<Extent> extents_;  ///< one of each of indices_
};

/// The boxes of an annotation as it has them, the k-th of number k + 1 in its mask; null for one
/// that was left out.
std::vector<Box*> boxes_as_annotated(Annotation& annotation);

/// What a frame's mask is called in the folder of masks, without its ending: the image's path below
/// the source's root, which `root` is as the manifest writes it; of a video's frame its own number
/// below that, without zeros before it.
std::filesystem::path mask_name(const std::string& root, const FrameRef& frame);

/// Gives each box that has no outline that of its object: number k is of the k-th box that the
/// annotation has, counted from 1, be it left out or not. A fault where the mask cannot be read, is
/// of another size than the image, white alone beside several boxes, has a number that no box has,
/// or one of whose pixels a quarter and more lie outside its box. The mask is read only if a box is
/// without outline. `written` is its file, and `place` the label's, in messages.
std::optional<SampleFault> give_outlines(const std::filesystem::path& file,
                                         const std::string& written, ImageSize image,
                                         const std::string& place, Annotation& annotation);

}  // namespace eventgan
