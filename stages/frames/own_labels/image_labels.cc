#include "stages/frames/own_labels/detail/image_labels.h"

#include <fmt/core.h>

#include <algorithm>

#include "manifests/documents/json_text.h"
#include "manifests/values/text.h"

namespace eventgan {

Outcome<Annotation> numbered(ImageLabels labels, const std::vector<std::string>& class_names,
                             ImageSize image, const std::string& place) {
  Annotation annotation;
  annotation.original = std::move(labels.original);
  for (NamedBox& named : labels.boxes) {
    const auto name = std::ranges::lower_bound(class_names, named.class_name);
    if (name == class_names.end() || *name != named.class_name) {
      return SampleFault{"expected a class that was there when the labels were opened, got \"" +
                         escape_controls(named.class_name) + "\", in " + place};
    }
    named.box.class_id = static_cast<int>(name - class_names.begin());
    if (named.again_at.empty()) {
      add_box(named.box, image, place, annotation);
    } else {
      leave_out_again(named.again_at, annotation);
    }
  }
  forget_shared_tracks(place, annotation);
  return annotation;
}

void Remarks::add(const ImageLabels& labels, const std::string& place) {
  for (const std::string& remark : labels.remarks) {
    Found& found = found_[remark];
    if (found.times++ == 0) found.first = place;
  }
}

void Remarks::move_to(std::vector<std::string>& notes) {
  for (const auto& [remark, found] : found_) {
    notes.push_back(remark + ": " + count_text(found.times, "time") + ", first in " + found.first);
  }
}

Outcome<Annotation> ReadLabels::annotation(const std::string& label_key) const {
  const auto found = by_key_.find(label_key);
  if (found == by_key_.end()) {
    return SampleFault{"expected a label, got none, in " + label_place(label_key)};
  }
  if (is_fault(found->second)) return found->second.fault();
  const ImageLabels& labels = *found->second;
  Outcome<ImageSize> size = image_size(label_key, labels.size);
  if (is_fault(size)) return size.fault();
  return numbered(labels, schema_.class_names, *size, label_place(label_key));
}

namespace {

void leave_out(const std::string& reason, Annotation& annotation) {
  annotation.left_out_at.push_back(annotation.boxes.size() + annotation.left_out.size());
  annotation.left_out.push_back(reason);
}

}  // namespace

void leave_out_again(const std::string& place, Annotation& annotation) {
  leave_out("expected each line once, got it again, in " + place, annotation);
}

bool add_box(const Box& box, ImageSize image, const std::string& place, Annotation& annotation) {
  if (overlaps(box.xyxy, image)) {
    annotation.boxes.push_back(box);
    return true;
  }
  leave_out(outside_text(box.xyxy, image) + ", in " + place, annotation);
  return false;
}

void note_parts_left_out(std::size_t count, std::size_t of_parts, const std::string& place,
                         Annotation& annotation) {
  if (count == 0) return;
  annotation.outlines_mended.push_back(
      fmt::format("expected parts of an outline that have an area, got {} of {} without, in {}",
                  count, of_parts, place));
}

void forget_shared_tracks(const std::string& place, Annotation& annotation) {
  std::map<std::int64_t, int> times;
  for (const Box& box : annotation.boxes) ++times[box.track_id];
  times.erase(Box().track_id);
  std::erase_if(times, [](const auto& track) { return track.second == 1; });
  for (const auto& [track, boxes] : times) {
    annotation.tracks_left_out.push_back(
        fmt::format("expected each track once in an image, got track {} of {} boxes, in {}", track,
                    boxes, place));
  }
  for (Box& box : annotation.boxes) {
    if (times.contains(box.track_id)) box.track_id = Box().track_id;
  }
}

bool overlaps(const Rectangle& box, ImageSize image) {
  return std::min(box.right, static_cast<double>(image.width)) > std::max(box.left, 0.0) &&
         std::min(box.bottom, static_cast<double>(image.height)) > std::max(box.top, 0.0);
}

std::string outside_text(const Rectangle& box, ImageSize image) {
  if (!(box.right > box.left && box.bottom > box.top)) {
    return fmt::format("expected a box of a width and height above 0, got {:g} x {:g}",
                       box.right - box.left, box.bottom - box.top);
  }
  return fmt::format("expected a box within the image of {}, got one from ({}, {}) to ({}, {})",
                     to_string(image), box.left, box.top, box.right, box.bottom);
}

}  // namespace eventgan
