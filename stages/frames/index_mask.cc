#include "stages/frames/index_mask.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "manifests/values/outlines.h"
#include "manifests/values/text.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/own_labels/detail/absent_frames.h"
#include "stages/frames/own_labels/detail/frame_names.h"
#include "stages/frames/source_folders.h"
#include "stages/frames/wrapped_dataset.h"

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

namespace {

/// The masks below a folder by what they are called without their ending.
std::map<std::string, std::string> masks_below(const SourceRoot& root) {
  constexpr int kDeepest = 8;
  std::map<std::string, std::string> masks;
  std::vector<std::string> folders{""};
  for (int level = 0; level < kDeepest && !folders.empty(); ++level) {
    std::vector<std::string> below;
    for (const std::string& folder : folders) {
      const std::string before = folder.empty() ? "" : folder + "/";
      for (const std::string& name : root.files_in(folder)) {
        const fs::path path(name);
        if (in_small_letters(path.extension().string()) != ".png" || name.starts_with('.'))
          continue;
        masks.emplace(before + path.stem().string(), before + name);
      }
      for (const std::string& name : root.folders_in(folder)) below.push_back(before + name);
    }
    folders = std::move(below);
  }
  return masks;
}

class OutlinedDataset final : public WrappedDataset {
 public:
  OutlinedDataset(std::unique_ptr<Dataset> dataset, const SourceSpec& spec, const fs::path& base)
      : WrappedDataset(std::move(dataset)),
        masks_(*spec.outlines, base),
        orientation_(orientation_of(spec.dataset)),
        base_(base) {
    masks_.require_folder("");
    find_masks(spec);
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    Outcome<Annotation> read = dataset_->annotation(label_key);
    const auto found = mask_of_.find(label_key);
    if (is_fault(read) || found == mask_of_.end()) return read;
    const auto& [image, mask] = found->second;
    const Outcome<ImageSize> size = image_sizes()->of(base_ / image, orientation_);
    if (is_fault(size)) return size.fault();
    auto fault = give_outlines(masks_.on_disk(mask), masks_.written(mask), *size,
                               label_place(label_key), *read);
    return fault ? Outcome<Annotation>(*std::move(fault)) : read;
  }

  ImageSizes* image_sizes() const override {
    ImageSizes* const others = dataset_->image_sizes();
    return others != nullptr ? others : &sizes_;
  }

  std::vector<std::string> annotation_files() const override {
    std::vector<std::string> files = dataset_->annotation_files();
    for (const auto& [label_key, mask] : mask_of_) files.push_back(masks_.written(mask.file));
    std::ranges::sort(files);
    files.erase(std::unique(files.begin(), files.end()), files.end());
    return files;
  }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = dataset_->notes();
    if (!note_.empty()) notes.push_back(note_);
    return notes;
  }

 private:
  struct Mask {
    std::string image;  ///< FrameRef::path
    std::string file;   ///< below the folder of masks
  };

  void find_masks(const SourceSpec& spec) {
    const std::map<std::string, std::string> masks = masks_below(masks_);
    std::map<std::string, std::string> of_videos;  // "STEM/12", without zeros
    for (const auto& [name, file] : masks) of_videos.emplace(video_frame_name(file), file);
    const std::string root = SourceRoot(spec.root, base_).written("");
    std::map<std::string, int> images;  // of one bare name
    std::vector<std::pair<fs::path, const LabelledFrame*>> named;
    for (const LabelledFrame& labelled : labelled_frames()) {
      if (labelled.frame.index == kAbsentFrame) continue;
      fs::path below = mask_name(root, labelled.frame);
      ++images[below.filename().string()];
      named.emplace_back(std::move(below), &labelled);
    }
    std::vector<std::string> without;
    for (const auto& [name, labelled] : named) {
      const auto& known = labelled->frame.video_frame < 0 ? masks : of_videos;
      const std::string bare = name.filename().string();
      auto mask = known.find(name.generic_string());
      if (mask == known.end() && images[bare] == 1) mask = known.find(bare);
      if (mask == known.end()) {
        without.push_back(labelled->sample_id);
      } else {
        mask_of_.emplace(labelled->label_key, Mask{labelled->frame.path, mask->second});
      }
    }
    if (mask_of_.empty()) {
      throw InputError("expected index masks of the labelled images, " +
                       (named.empty() ? "NAME" : named.front().first.generic_string()) +
                       ".png and so on, got of none of the " + std::to_string(named.size()) +
                       ", in " + masks_.written(""));
    }
    if (without.empty()) return;
    note_ = "no index mask for " + std::to_string(without.size()) + " of " +
            count_text(std::ssize(named), "labelled frame") + " in " + masks_.written("") +
            ": boxes without outlines, first of " + without.front();
  }

  SourceRoot masks_;
  ImageOrientation orientation_;
  fs::path base_;
  std::unordered_map<std::string, Mask> mask_of_;  ///< by label_key
  std::string note_;
  mutable ImageSizes sizes_;  ///< where the dataset has none
};

}  // namespace

std::unique_ptr<Dataset> with_outlines(std::unique_ptr<Dataset> dataset, const SourceSpec& spec,
                                       const fs::path& base) {
  return std::make_unique<OutlinedDataset>(std::move(dataset), spec, base);
}

}  // namespace eventgan
