#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/frames/naming/own_labels.h"

namespace eventgan {

/// Thrown where a label is not as it should be, with what was expected and what is there; where the
/// file and the place in it are known it is caught, and is the fault of one image.
struct BadLabel : std::runtime_error {
  explicit BadLabel(const std::string& reason) : std::runtime_error(reason) {}
  BadLabel(std::string_view expected, std::string_view got)
      : std::runtime_error("expected " + std::string(expected) + ", got " + std::string(got)) {}

  SampleFault in(const std::string& place) const { return {what() + (", in " + place)}; }
};

/// A box and its class by name: which number that is shows once all files are read.
struct NamedBox {
  std::string class_name;
  Box box;                    ///< class_id is 0
  std::string again_at = {};  ///< of a line that is there already: its place
};

/// What a file says about one image.
struct ImageLabels {
  std::string original;           ///< the file's bytes about it, unchanged
  std::vector<NamedBox> boxes;    ///< pixels of the image, edges (manifests/values/labels.h)
  std::optional<ImageSize> size;  ///< of the image, where the file tells it
  /// What is in it that the format does not have, and how it was taken, for Remarks.
  std::vector<std::string> remarks = {};
};

/// The remarks on many images, each once.
class Remarks {
 public:
  void add(const ImageLabels& labels, const std::string& place);
  /// "REMARK: 3 times, first in PATH".
  void move_to(std::vector<std::string>& notes);

 private:
  struct Found {
    std::int64_t times = 0;
    std::string first;
  };
  std::map<std::string, Found> found_;
};

/// The names of all classes, in the order of their names.
class ClassList {
 public:
  void add(const Outcome<ImageLabels>& labels) {
    if (is_fault(labels)) return;
    for (const NamedBox& box : labels->boxes) names_.insert(box.class_name);
  }
  std::vector<std::string> names() const { return {names_.begin(), names_.end()}; }

 private:
  std::set<std::string> names_;
};

/// The labels of an image of that size, with the classes' numbers. `place` is for a fault.
Outcome<Annotation> numbered(ImageLabels labels, const std::vector<std::string>& class_names,
                             ImageSize image, const std::string& place);

/// Labels that are in memory, by label_key.
class ReadLabels : public OwnLabels {
 public:
  Outcome<Annotation> annotation(const std::string& label_key) const override;

 protected:
  explicit ReadLabels(LabelledSource labelled) : OwnLabels(std::move(labelled)) {}

  std::map<std::string, Outcome<ImageLabels>> by_key_;
};

/// Adds a box of an image of that size to the image's annotation, and returns true, if it has an
/// area and some of it lies within the image: detectors' losses cannot take another. Else the
/// reason goes to Annotation::left_out, so that one bad box does not lose the image's others.
/// `place` is where the box stands, for the reason.
bool add_box(const Box& box, ImageSize image, const std::string& place, Annotation& annotation);

/// Counts a box among those that are left out, for a line that is there already.
void leave_out_again(const std::string& place, Annotation& annotation);

/// Tells that parts of the outline of the box that was added last are left out, if any are.
void note_parts_left_out(std::size_t count, std::size_t of_parts, const std::string& place,
                         Annotation& annotation);

/// Takes the track from all boxes of an image whose track another one has, too: it is no object's
/// number then. Tells of each such track that it is left out.
void forget_shared_tracks(const std::string& place, Annotation& annotation);

/// Whether some of the box is within the image.
bool overlaps(const Rectangle& box, ImageSize image);

/// "expected a box within the image of 640x480, got one from (LEFT, TOP) to (RIGHT, BOTTOM)".
std::string outside_text(const Rectangle& box, ImageSize image);

}  // namespace eventgan
