#include "pipeline/planning/outline_masks.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "manifests/documents/report.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "manifests/values/outlines.h"
#include "manifests/values/text.h"
#include "pipeline/planning/spread.h"
#include "pipeline/runtime/threads.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/index_mask.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/sources/frame_selection.h"
#include "stages/frames/sources/open_dataset.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

struct OutlinedSource {
  const SourceSpec* spec;
  fs::path folder;  ///< of the masks
  std::unique_ptr<Dataset> dataset;
};

struct MaskWork {
  const OutlinedSource* source = nullptr;
  LabelledFrame frame = {};
  fs::path mask = {};
  std::string fault = {};  ///< none: it is made or there
  bool is_done = false;    ///< or at fault
  bool is_kept = false;
  OutlineCounts outlines = {};
};

/// The sources of frames, open, each with the folder of its masks.
std::vector<OutlinedSource> open_sources(const JobManifest& manifest, const fs::path& out) {
  std::vector<OutlinedSource> sources;
  for (const SourceSpec& spec : manifest.sources) {
    if (!has_events(spec.dataset)) sources.push_back({&spec, out, nullptr});
  }
  if (sources.empty()) throw UsageError("expected a source of frames, got recordings of events");
  std::map<std::string, int> names;
  for (OutlinedSource& source : sources) {
    if (sources.size() > 1) {
      const std::string name = SourceRoot(source.spec->root, manifest.directory).name();
      const int others = names[name]++;
      source.folder /= others == 0 ? name : name + "-" + std::to_string(others + 1);
    }
    SourceSpec spec = *source.spec;
    // The masks that this is to make, or to go on with, are not its own input.
    if (spec.outlines && fs::weakly_canonical(resolve(manifest, *spec.outlines)) ==
                             fs::weakly_canonical(fs::absolute(source.folder))) {
      spec.outlines.reset();
    }
    source.dataset = open_dataset(spec, manifest.directory);
  }
  return sources;
}

std::vector<MaskWork> list_work(const JobManifest& manifest,
                                const std::vector<OutlinedSource>& sources) {
  std::vector<MaskWork> works;
  std::map<fs::path, std::string> images;  // by mask
  for (const OutlinedSource& source : sources) {
    const std::string root = SourceRoot(source.spec->root, manifest.directory).written("");
    for (LabelledFrame& frame : select_frames(source.dataset->labelled_frames(), *source.spec,
                                              manifest.directory, manifest.seed)
                                    .frames) {
      MaskWork work{.source = &source, .frame = std::move(frame)};
      work.mask = source.folder / mask_name(root, work.frame.frame) += ".png";
      const auto [other, is_first] = images.emplace(work.mask, work.frame.frame.path);
      if (!is_first) {
        work.fault = "expected one image of " + work.mask.string() + ", got " + other->second +
                     " and " + work.frame.frame.path + " (" + work.frame.sample_id + ")";
      }
      works.push_back(std::move(work));
    }
  }
  return works;
}

/// Throws UsageError if the masks would be read as images by the next search: among the images
/// themselves, or in a folder that is searched, since its parent has no images.
void require_apart(const JobManifest& manifest, const std::vector<MaskWork>& works) {
  std::set<fs::path> images;
  const auto on_disk = [&](const fs::path& path) {
    return fs::weakly_canonical(fs::absolute(manifest.directory / path));
  };
  for (const MaskWork& work : works) {
    images.insert(fs::path(work.frame.frame.path).parent_path());
  }
  std::set<fs::path> canonical;
  for (const fs::path& folder : images) canonical.insert(on_disk(folder));
  std::set<const OutlinedSource*> seen;
  for (const MaskWork& work : works) {
    if (!seen.insert(work.source).second) continue;
    fs::path masks = fs::weakly_canonical(fs::absolute(work.source->folder));
    if (!masks.has_filename()) masks = masks.parent_path();  // "masks/"
    const fs::path root = on_disk(work.source->spec->root);
    const fs::path below = masks.lexically_relative(root);
    const bool is_in_root = !below.empty() && *below.begin() != "..";
    if (!canonical.contains(masks) && (!is_in_root || canonical.contains(masks.parent_path()))) {
      continue;
    }
    throw UsageError("expected a folder that is not searched for images, got one below " +
                     root.string() + ", in " + masks.string() + " (choose another --out)");
  }
}

/// Draws an object's number where its outline is.
void draw(const Outline& outline, std::uint16_t number, ImageSize size,
          std::vector<std::uint16_t>& indices) {
  const Rectangle around = bounds(outline);
  const auto within = [](double edge, int end) {
    return static_cast<int>(std::clamp(edge, 0.0, double(end)));
  };
  const int left = within(std::floor(around.left), size.width);
  const int top = within(std::floor(around.top), size.height);
  Outline moved = outline;
  for (std::vector<Point>& ring : moved.rings) {
    for (Point& corner : ring) corner = {corner.x - left, corner.y - top};
  }
  const GreyImage mask = mask_of(moved, {within(std::ceil(around.bottom), size.height) - top,
                                         within(std::ceil(around.right), size.width) - left});
  for (int y = 0; y < mask.size.height; ++y) {
    for (int x = 0; x < mask.size.width; ++x) {
      if (mask.pixels[static_cast<std::size_t>(y * mask.size.width + x)] == 0) continue;
      indices[static_cast<std::size_t>(top + y) * static_cast<std::size_t>(size.width) +
              static_cast<std::size_t>(left + x)] = number;
    }
  }
}

/// The objects by their numbers in the annotation, nearer ones over farther ones.
std::vector<std::uint16_t> draw_all(Annotation& annotation, ImageSize size) {
  const std::vector<Box*> boxes = boxes_as_annotated(annotation);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (boxes[i] != nullptr && !boxes[i]->ignore) order.push_back(i);
  }
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return boxes[i]->xyxy.bottom; });
  std::vector<std::uint16_t> indices(size.pixel_count());
  for (const std::size_t i : order) {
    draw(boxes[i]->outline, static_cast<std::uint16_t>(i + 1), size, indices);
  }
  return indices;
}

/// Throws std::system_error if the disk fails.
void make_mask(const JobManifest& manifest, const FrameDecoder& decoder, MaskWork& work) {
  const auto fail = [&](std::string reason) {
    const std::string id = " (" + work.frame.sample_id + ")";
    work.fault = reason.ends_with(id) ? std::move(reason) : std::move(reason) + id;
  };
  if (fs::exists(work.mask)) {
    work.is_kept = true;
    return;
  }
  const SourceSpec& spec = *work.source->spec;
  Outcome<Annotation> annotation = work.source->dataset->annotation(work.frame.label_key);
  if (is_fault(annotation)) return fail(annotation.fault().reason);
  const Outcome<ColourFrame> image = decoder.decode(
      work.frame.frame, spec.every, orientation_of(spec.dataset), manifest.image.range);
  if (is_fault(image)) return fail(image.fault().reason);
  const std::size_t objects = annotation->boxes.size() + annotation->left_out_at.size();
  if (objects > kMostMaskObjects) {
    return fail("expected at most " + std::to_string(kMostMaskObjects) + " boxes, got " +
                std::to_string(objects) + ", in " +
                work.source->dataset->label_place(work.frame.label_key));
  }
  work.outlines = cut_out_missing({image->size, image->bgr.data()}, annotation->boxes);
  fs::create_directories(work.mask.parent_path());
  write_file_atomically(work.mask,
                        encode_index_png(image->size, draw_all(*annotation, image->size)));
}

/// As a manifest in that folder may name another one.
std::string name_in(const JobManifest& manifest, const fs::path& folder) {
  const fs::path absolute = fs::absolute(folder).lexically_normal();
  const fs::path below = absolute.lexically_relative(manifest.directory.lexically_normal());
  const bool is_below = !below.empty() && *below.begin() != "..";
  return (is_below ? below : absolute).generic_string();
}

}  // namespace

OutlineMasksReport make_outline_masks(const JobManifest& manifest,
                                      const OutlineMasksOptions& options) {
  const std::vector<OutlinedSource> sources = open_sources(manifest, options.out);
  std::vector<MaskWork> works = list_work(manifest, sources);
  require_apart(manifest, works);
  std::set<fs::path> folders;
  for (const MaskWork& work : works) folders.insert(work.mask.parent_path());
  for (const fs::path& folder : folders) {
    if (fs::is_directory(folder)) remove_stale_temporaries(folder);
  }
  const FrameDecoder decoder(manifest.directory);
  // Masks that are kept take no time: counted, they would make the others look fast.
  const std::int64_t to_make = std::ranges::count_if(
      works, [](const MaskWork& work) { return !work.fault.empty() || !fs::exists(work.mask); });
  const auto progress =
      options.make_progress && to_make > 0 ? options.make_progress(to_make) : nullptr;
  for_each_index(works.size(), thread_count(options.threads), [&](std::size_t i) {
    if (options.stop && options.stop()) return;
    MaskWork& work = works[i];
    if (work.fault.empty()) make_mask(manifest, decoder, work);
    work.is_done = true;
    if (progress && !work.is_kept) progress->advance(!work.fault.empty(), /*bytes=*/0);
  });
  if (progress) progress->finish();

  OutlineMasksReport report;
  for (const OutlinedSource& source : sources) {
    report.sources.push_back({source.spec->root, name_in(manifest, source.folder)});
  }
  report.images = std::ssize(works);
  for (const MaskWork& work : works) {
    if (!work.is_done) continue;
    if (!work.fault.empty()) {
      report.faults.push_back(work.fault);
      continue;
    }
    ++(work.is_kept ? report.kept : report.made);
    report.outlines += work.outlines;
    if (work.outlines.ellipses > 0) report.of_ellipses.push_back(work.mask.string());
  }
  return report;
}

namespace {

Report table_of(const OutlineMasksReport& report) {
  constexpr std::ptrdiff_t kMostFaults = 20;
  constexpr std::size_t kMostEllipses = 5;
  using Source = decltype(report.sources)::value_type;
  return {{"event", "report"},
          {"faults", report.faults, listed(report.faults, kMostFaults, "", std::identity())},
          {"images", report.images},
          {"made", report.made},
          {"kept", report.kept},
          fmt::format("masks: {} made, {} kept, {} failed", report.made, report.kept,
                      report.faults.size()),
          {"given", report.outlines.given},
          {"cut", report.outlines.cut},
          {"ellipses", report.outlines.ellipses},
          {"of_ellipses", report.of_ellipses},
          "outlines: " + to_text(report.outlines) +
              (report.of_ellipses.empty()
                   ? ""
                   : " in " + escape_controls(some_of(report.of_ellipses, kMostEllipses))),
          {"sources",
           json_list(report.sources,
                     [](const Source& source) -> nlohmann::json {
                       return {{"root", source.root}, {"outlines", source.outlines}};
                     }),
           joined(report.sources, "", [](const Source& source) {
             return fmt::format("for the source of {} in the manifest:  \"outlines\": {}\n",
                                escape_controls(source.root),
                                dump_json(nlohmann::json(source.outlines)));
           })}};
}

}  // namespace

std::string to_text(const OutlineMasksReport& report) { return text_of(table_of(report)); }
std::string to_json(const OutlineMasksReport& report) { return json_text_of(table_of(report)); }

namespace {

double overlap_over_union(const Rectangle& a, const Rectangle& b) {
  const auto area = [](const Rectangle& box) {
    return std::max(box.right - box.left, 0.0) * std::max(box.bottom - box.top, 0.0);
  };
  const double common = area({std::max(a.left, b.left), std::max(a.top, b.top),
                              std::min(a.right, b.right), std::min(a.bottom, b.bottom)});
  return common / std::max(area(a) + area(b) - common, 1e-9);
}

}  // namespace

std::string masks_fault(SourceSpec spec, const fs::path& folder) try {
  constexpr std::size_t kMost = 8;
  constexpr double kLeast = 0.7;
  const auto outlined = open_dataset(spec, folder);
  spec.outlines.reset();
  const auto plain = open_dataset(spec, folder);
  const auto& frames = plain->labelled_frames();
  std::vector<double> overlaps;
  std::vector<std::string> faults;
  std::size_t fitting = 0, most_boxes = 0, most_objects = 0;
  for (const std::size_t i : spread(kMost, frames.size())) {
    if (is_fault(plain->annotation(frames[i].label_key))) continue;  // of the label
    const Outcome<Annotation> read = outlined->annotation(frames[i].label_key);
    if (is_fault(read)) {
      faults.push_back(read.fault().reason);
      continue;
    }
    std::size_t objects = 0;
    for (const Box& box : read->boxes) {
      if (box.outline.empty()) continue;
      ++objects;
      overlaps.push_back(overlap_over_union(box.xyxy, bounds(box.outline)));
    }
    if (objects > 0) ++fitting;
    most_boxes = std::max(most_boxes, read->boxes.size());
    most_objects = std::max(most_objects, objects);
  }
  if (faults.size() > fitting) return faults.front();
  if (overlaps.empty()) return "";
  const auto middle = overlaps.begin() + std::ssize(overlaps) / 2;
  std::ranges::nth_element(overlaps, middle);
  if (*middle < kLeast) {
    return fmt::format("expected pixels all over the boxes, got an overlap of {:.2g}", *middle);
  }
  if (most_boxes > 1 && most_objects < 2) {
    return fmt::format("expected a number for each box, got one beside {} boxes", most_boxes);
  }
  return "";
} catch (const InputError& error) {
  return error.what();
}

}  // namespace eventgan
