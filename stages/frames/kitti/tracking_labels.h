#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/faults.h"
#include "manifests/labels.h"

namespace eventgan {

/// A label file of KITTI tracking, label_02/SEQ.txt: lines of frame, track id and the columns of
/// KITTI object. Kept as text, found by frame; thread-safe.
class TrackingLabels {
 public:
  /// `path` is for messages. A line whose frame number cannot be read may belong to any frame, so
  /// every annotation is then the fault that names it.
  TrackingLabels(std::string text, std::string path);
  /// A file that cannot be read: every annotation is the fault that says so.
  explicit TrackingLabels(SampleFault unreadable) : fault_(std::move(unreadable)) {}

  /// Frames that some line names, ascending.
  std::vector<std::int64_t> frames() const;

  /// `original` is the frame's lines, byte for byte and in the file's order; "" for a frame without
  /// objects. A fault names the file and the line.
  Outcome<Annotation> annotation(std::int64_t frame) const;

 private:
  struct Line {
    std::size_t offset;
    std::size_t length;
    int number;
  };

  std::string text_;
  std::string path_;
  std::map<std::int64_t, std::vector<Line>> lines_;  ///< by frame
  std::optional<SampleFault> fault_;
};

}  // namespace eventgan
