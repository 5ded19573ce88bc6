#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {

/// KITTI records at 10 Hz: seconds between frames where no timestamps are there.
inline constexpr double kKittiFrameSeconds = 0.1;

/// A timestamps.txt of KITTI raw: line i (from 0) holds "2011-09-26 13:02:25.594360375" for frame
/// i. Gives seconds since the first line, exact to the nanosecond; NaN for a blank line. A fault
/// that names `path` and the line for any other line, for a time that is not after those above it,
/// and for a last line that is cut short: without a line end, and shorter than the first.
Outcome<std::vector<double>> parse_timestamps(std::string_view text, const std::string& path);

/// Whether a folder of KITTI raw is named as those that hold the drives of a day: "2011_09_26".
bool is_kitti_date(const std::string& folder);

/// DatasetReader::origin of KITTI, whose sequences are drives.
FrameOrigin kitti_origin(const std::string& drive);

/// What manifests of KITTI say, but for a kind's own.
inline constexpr DraftHabits kKittiHabits{
    .size_comment =
        "The size that the generator's authors trained with; boxes are scaled with the images.",
    .size = R"("width": 861, "height": 260, "fit": "stretch")"};

/// The left colour camera's frames of one drive of KITTI raw:
/// DATE/DRIVE/image_02/data/NNNNNNNNNN.png, and image_02/timestamps.txt if it is there. Thread-safe
/// once built.
class RawDrive {
 public:
  /// `folder` is DATE/DRIVE below `root`. A drive that is not there has no frames. Throws
  /// InputError for a folder that cannot be read.
  RawDrive(const SourceRoot& root, const std::string& folder);

  const NumberedSequence& images() const { return images_; }

  /// Frame `number`.
  PairedFrame frame(std::int64_t number) const;

  /// The frame `steps` after frame `number`, which is there: the drive stores every frame.
  PairedFrame paired_frame(std::int64_t number, int steps) const;

  /// Why none of its frames can be timed: its timestamps.txt cannot be read, is not as
  /// parse_timestamps asks, or ends before the last image. Empty if nothing is wrong.
  const std::string& fault() const { return fault_; }

  /// Seconds since the first timestamp (NaN past the last one); without timestamps 0.1 s a frame.
  double time_s(std::int64_t number) const;

  /// timestamps.txt as FrameRef::path writes paths; empty if there is none.
  const std::string& timestamps_path() const { return timestamps_path_; }

 private:
  PairedFrame at(const NumberedSequence::Place& place) const;

  std::string images_path_;
  std::string timestamps_path_;
  std::string fault_;
  NumberedSequence images_;
  std::vector<double> times_s_;
};

/// A frame of KITTI raw.
struct RawFrame {
  std::string date;   ///< "2011_09_26"
  std::string drive;  ///< "2011_09_26_drive_0052_sync"
  std::int64_t number = 0;
  bool operator==(const RawFrame&) const = default;
};

/// Where the training images of KITTI object come from, as the devkit's two files tell: image n
/// (from 0) is line rand[n] (from 1) of the mapping, whose lines read "DATE DRIVE FRAME".
class RawMapping {
 public:
  /// Parses mapping/train_rand.txt and mapping/train_mapping.txt; the paths are for messages.
  /// Throws InputError for anything that is not as above.
  RawMapping(std::string_view rand, const std::string& rand_path, std::string_view mapping,
             const std::string& mapping_path);

  /// Nothing for an image that the devkit does not know.
  std::optional<RawFrame> find(std::int64_t object_number) const;

 private:
  std::vector<RawFrame> frames_;  ///< by object number
};

}  // namespace eventgan
