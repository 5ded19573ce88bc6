#include "stages/frames/decoding/index_mask.h"

#include <fmt/core.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "manifests/values/outlines.h"
#include "manifests/values/text.h"

namespace eventgan {
namespace fs = std::filesystem;

IndexMask::IndexMask(IndexImage image) : image_(std::move(image)) {
  constexpr int kVoid = 255;
  const Extent none{image_.size.height, -1, image_.size.width, -1};
  std::vector<Extent> extents(std::size_t{1} << std::max(image_.bits, 8), none);
  std::size_t i = 0;
  for (int y = 0; y < image_.size.height; ++y) {
    for (int x = 0; x < image_.size.width; ++x, ++i) {
      Extent& extent = extents[image_.indices[i]];
      extent = {std::min(extent.top, y), y, std::min(extent.left, x), std::max(extent.right, x)};
    }
  }
  const auto is_there = [&](std::size_t index) { return extents[index].right >= 0; };
  if (image_.bits <= 8 && is_there(kVoid)) {
    bool is_alone = !image_.has_palette;
    for (std::size_t index = 1; index < kVoid; ++index) is_alone &= !is_there(index);
    std::ranges::replace(image_.indices, std::uint16_t{kVoid}, std::uint16_t{is_alone});
    if (is_alone) extents[1] = extents[kVoid];
    is_white_ = is_alone;
    extents[kVoid] = none;
  }
  for (std::size_t index = 1; index < extents.size(); ++index) {
    if (!is_there(index)) continue;
    indices_.push_back(static_cast<int>(index));
    extents_.push_back(extents[index]);
  }
}

Outcome<IndexMask> IndexMask::read(const fs::path& file, const std::string& written) try {
  IndexMask mask(decode_index_image(open_image_file(file)));
  const auto too_many = [&](std::size_t most, const std::string& what, std::size_t got) {
    return SampleFault{"expected at most " + std::to_string(most) + " " + what + ", got " +
                       std::to_string(got) + ", in " + written};
  };
  const std::size_t objects = mask.indices_.size();
  if (objects > kMostMaskObjects) return too_many(kMostMaskObjects, "objects", objects);
  const std::size_t corners = corner_count(mask.image_.indices, mask.size());
  if (corners > kMostCorners) return too_many(kMostCorners, "corners of outlines", corners);
  constexpr std::size_t kMostPixels = 4'000'000'000;  // looked at in some seconds
  std::size_t around = 0;
  for (const auto& [top, bottom, left, right] : mask.extents_) {
    around += ImageSize{bottom - top + 1, right - left + 1}.pixel_count();
  }
  if (around > kMostPixels) return too_many(kMostPixels, "pixels around all objects", around);
  return mask;
} catch (const std::runtime_error& error) {
  return SampleFault{std::string(error.what()) + ", in " + written};
}

const IndexMask::Extent& IndexMask::extent(int index) const {
  static constexpr Extent kNone{0, -1, 0, -1};
  const auto found = std::ranges::lower_bound(indices_, index);
  return found == indices_.end() || *found != index
             ? kNone
             : extents_[static_cast<std::size_t>(found - indices_.begin())];
}

double IndexMask::share_in(int index, const Rectangle& area) const {
  const auto [top, bottom, left, right] = extent(index);
  std::size_t all = 0, within = 0;
  for (int y = top; y <= bottom; ++y) {
    const bool is_row_in = y + 0.5 > area.top && y + 0.5 < area.bottom;
    const std::size_t row =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(image_.size.width);
    for (int x = left; x <= right; ++x) {
      if (image_.indices[row + static_cast<std::size_t>(x)] != index) continue;
      ++all;
      if (is_row_in && x + 0.5 > area.left && x + 0.5 < area.right) ++within;
    }
  }
  return all == 0 ? 0 : static_cast<double>(within) / static_cast<double>(all);
}

Outline IndexMask::outline(int index) const {
  const auto [top, bottom, left, right] = extent(index);
  GreyImage mask{{bottom - top + 1, right - left + 1}, {}};
  mask.pixels.reserve(mask.size.pixel_count());
  for (int y = top; y <= bottom; ++y) {
    const std::size_t row =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(image_.size.width);
    for (int x = left; x <= right; ++x) {
      mask.pixels.push_back(image_.indices[row + static_cast<std::size_t>(x)] == index);
    }
  }
  Outline outline = outline_of(mask);
  for (std::vector<Point>& ring : outline.rings) {
    for (Point& corner : ring) corner = {corner.x + left, corner.y + top};
  }
  return outline;
}

std::vector<Box*> boxes_as_annotated(Annotation& annotation) {
  std::vector<Box*> boxes;
  for (Box& box : annotation.boxes) boxes.push_back(&box);
  for (const std::size_t at : annotation.left_out_at) {  // ascending
    boxes.insert(boxes.begin() + static_cast<std::ptrdiff_t>(std::min(at, boxes.size())), nullptr);
  }
  return boxes;
}

fs::path mask_name(const std::string& root, const FrameRef& frame) {
  const std::string& path = frame.path;
  fs::path name = path.starts_with(root + "/") ? fs::path(path.substr(root.size() + 1))
                  : path == root               ? fs::path(path).filename()
                                               : fs::path(path);
  name.replace_extension();
  if (frame.video_frame >= 0) name /= std::to_string(frame.video_frame);
  return name;
}

namespace {

std::string corners_text(const Rectangle& box) {
  return fmt::format("({:g}, {:g}) to ({:g}, {:g})", box.left, box.top, box.right, box.bottom);
}

}  // namespace

std::optional<SampleFault> give_outlines(const fs::path& file, const std::string& written,
                                         ImageSize image, const std::string& place,
                                         Annotation& annotation) {
  const auto has_none = [](const Box& box) { return box.outline.empty(); };
  if (std::ranges::none_of(annotation.boxes, has_none)) return std::nullopt;
  const Outcome<IndexMask> read = IndexMask::read(file, written);
  if (is_fault(read)) return read.fault();
  const IndexMask& mask = *read;
  if (mask.size() != image) {
    return SampleFault{"expected a mask of " + to_string(image) + ", as the image is, got " +
                       to_string(mask.size()) + ", in " + written};
  }
  const std::vector<Box*> boxes = boxes_as_annotated(annotation);
  if (mask.is_white() && boxes.size() > 1) {
    return SampleFault{"expected a number for each of the " + count_text(std::ssize(boxes), "box") +
                       " in " + place + ", got white (255) alone, in " + written};
  }
  for (const int index : mask.indices()) {
    if (index > std::ssize(boxes)) {
      return SampleFault{"expected numbers of the " + count_text(std::ssize(boxes), "box") +
                         " in " + place + ", got " + std::to_string(index) + ", in " + written};
    }
    Box* const box = boxes[static_cast<std::size_t>(index - 1)];
    if (box == nullptr || !box->outline.empty()) continue;
    box->outline = mask.outline(index);
    const Rectangle around = bounds(box->outline);
    const Rectangle& own = box->xyxy;
    const bool meet = around.left < own.right && around.right > own.left &&
                      around.top < own.bottom && around.bottom > own.top;
    // Boxes are rounded and drawn by hand.
    const double beside_x = 2 + 0.05 * (own.right - own.left);
    const double beside_y = 2 + 0.05 * (own.bottom - own.top);
    constexpr double kLeast = 0.75;
    if (meet && mask.share_in(index, {own.left - beside_x, own.top - beside_y, own.right + beside_x,
                                      own.bottom + beside_y}) >= kLeast) {
      continue;
    }
    return SampleFault{"expected most pixels of number " + std::to_string(index) +
                       " in the box from " + corners_text(own) + " of " + place +
                       ", got them from " + corners_text(around) + ", in " + written};
  }
  return std::nullopt;
}

}  // namespace eventgan
