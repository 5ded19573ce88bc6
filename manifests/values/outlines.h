#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"

namespace eventgan {

/// How many outlines boxes have, and whence.
struct OutlineCounts {
  std::int64_t given = 0;  ///< the labels' own
  std::int64_t cut = 0;
  std::int64_t ellipses = 0;  ///< in place of a cut

  OutlineCounts& operator+=(const OutlineCounts& other);
  bool operator==(const OutlineCounts&) const = default;
};

/// "120 of labels, 300 cut out of their boxes, 12 ellipses".
std::string to_text(const OutlineCounts& counts);

/// Twice the area within a ring that runs clockwise as one sees it, minus that of another.
double twice_area(const std::vector<Point>& ring);

/// Whether its corners do not all lie on one line.
bool has_area(const std::vector<Point>& ring);

/// An outline of parts that may overlap, each a ring, as COCO and YOLO write them, and whichever
/// way they run. A ring that comes back to a corner is several: where a line joins parts or leads
/// to a hole, be it there and back or from each part to the next one, the line is no part of the
/// outline. A ring that lies in no other one of its part is turned to run clockwise, and those in
/// it with it. Rings without area are left out; `without_area`, if given, is how many parts lose
/// all of theirs.
Outline outline_of_parts(const std::vector<std::vector<Point>>& parts,
                         std::size_t* without_area = nullptr);

/// Outlines of an image that have more corners are noise, and take more memory than it is worth.
inline constexpr std::size_t kMostCorners = 1'000'000;

std::size_t corner_count(const Outline& outline);

/// How many corners the outlines of all numbers but 0 have together; `pixels` is [y, x].
template <class Pixel>  // std::uint8_t or std::uint16_t
std::size_t corner_count(const std::vector<Pixel>& pixels, ImageSize size);

/// The edges of the pixels of `mask` that are not 0, exactly: its rings have whole coordinates, and
/// pixels that touch at a corner alone lie in rings of their own.
Outline outline_of(const GreyImage& mask);

/// What rings cover: what they wind around at all, or an odd number of times (even-odd).
enum class FillRule { kNonZero, kByTurns };

/// [y, x] uint8: 1 where the outline covers the pixel's centre, else 0; what lies outside `size` is
/// left out. A centre that lies on an edge belongs to the part right of it or below it, so that
/// outlines side by side cover each pixel once. mask_of(outline_of(mask), mask.size) == mask.
GreyImage mask_of(const Outline& outline, ImageSize size, FillRule rule = FillRule::kNonZero);

/// The least rectangle around all corners; {0, 0, 0, 0} of an empty outline.
Rectangle bounds(const Outline& outline);

/// COCO's run lengths of a mask: how many pixels are 0, then how many are not, and so on by turns,
/// column by column from top to bottom.
std::vector<std::uint32_t> run_lengths(const GreyImage& mask);

/// The mask with these run lengths; none if they do not sum up to the number of its pixels.
std::optional<GreyImage> mask_of(const std::vector<std::uint32_t>& runs, ImageSize size);

/// COCO's text of run lengths: from the fourth on, each is less the one two before it; five bits a
/// character, the lowest first, 32 where more follow, plus 48.
std::string compressed(const std::vector<std::uint32_t>& runs);

/// The inverse; none if the text is no such thing.
std::optional<std::vector<std::uint32_t>> run_lengths(std::string_view compressed);

/// The outline as JSON, [[x, y, x, y, ...], ...], a list a ring; "" of an empty one. Coordinates
/// are rounded to float32, with the fewest digits that give the same float32. This is
/// `/labels/boxes/outline`.
std::string outline_text(const Outline& outline);

/// The inverse; none if the text is no such thing, or a ring has fewer than three corners.
std::optional<Outline> read_outline(std::string_view text);

}  // namespace eventgan
