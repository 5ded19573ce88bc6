#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

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

/// KITTI tracking: image_02/SEQ/NNNNNN.png and label_02/SEQ.txt below the root, at 10 Hz. In a
/// sequence with a label file every image is a labelled frame (without objects if no line names
/// it), and so is every frame that a line names. sample_id "0001/000012", label_key
/// "label_02/0001.txt#12".
std::unique_ptr<Dataset> open_kitti_tracking_dataset(const SourceSpec& spec,
                                                     const std::filesystem::path& base);

extern const DatasetReader kKittiTrackingReader;

}  // namespace eventgan
