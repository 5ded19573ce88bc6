#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {

/// The images of KITTI object itself: image_2 and the three frames before each in prev_2. Listed
/// once; thread-safe.
class ObjectImages {
 public:
  static constexpr int kPrevious = 3;  ///< prev_2 reaches as far back as this

  /// Throws InputError if there is no image_2; prev_2 may be absent.
  explicit ObjectImages(const SourceRoot& root);

  const NumberedSequence& labelled() const { return labelled_; }

  /// Files of prev_2 whose names are none of a previous frame, sorted.
  const std::vector<std::string>& previous_left_out() const { return previous_left_out_; }

  /// The image `steps` (-3..0) after image `number`, below the root; where it is absent, the
  /// path it would have, given that the image's name is `stem`. A missing frame if an earlier frame
  /// is there.
  struct Place {
    PairedFrame::State state;
    std::string path;
  };
  Place at(std::int64_t number, const std::string& stem, int steps) const;

 private:
  NumberedSequence labelled_;
  std::array<NumberedSequence, kPrevious> previous_;  ///< by K - 1
  std::vector<std::string> previous_left_out_;
};

/// KITTI object: label_2/NNNNNN.txt, image_2/NNNNNN.png, prev_2/NNNNNN_0K.png (K = 1..3, the frame
/// K before) below the root. Every label file is a labelled frame, its sample_id the file's name
/// without ".txt".
///
/// With `raw_root` and `devkit`, devkit/mapping leads to the raw drive: FrameRef::index is then the
/// raw frame's number and `sequence` the drive, and paired frames come from prev_2 where it has
/// them (its images are those of the raw drive, pixel for pixel), else from the drive. Without,
/// index is 0 for the labelled frame and -K for the frame K before. With `devkit` alone drive and
/// number are known, no frames beyond prev_2. Times are the drive's timestamps, or 0.1 s a frame.
///
/// calib/NNNNNN.txt, where it is there, gives Annotation::projection (P2).
///
/// What the mapping says is compared with what is stored: of each drive one image, labelled or
/// previous, with the raw frame it should be, and the pixels must be equal. Where they are not,
/// where a previous image would come before the drive's first frame, and where the drive's
/// timestamps are damaged, the frames are at fault (LabelledFrame::fault).
///
/// Throws UsageError if `raw_root` is given without `devkit`.
std::unique_ptr<Dataset> open_kitti_object_dataset(const SourceSpec& spec,
                                                   const std::filesystem::path& base);

extern const DatasetReader kKittiObjectReader;

}  // namespace eventgan
