#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/frames/dataset.h"
#include "stages/frames/numbered_sequence.h"
#include "stages/frames/source_root.h"

namespace eventgan {

/// The left colour camera's frames of one drive of KITTI raw:
/// DATE/DRIVE/image_02/data/NNNNNNNNNN.png, and image_02/timestamps.txt if it is there. Thread-safe
/// once built.
class RawDrive {
 public:
  /// `folder` is DATE/DRIVE below `root`. A drive that is not there has no frames. Throws
  /// InputError for a folder that cannot be read.
  RawDrive(const SourceRoot& root, const std::string& folder);

  const NumberedSequence& pictures() const { return pictures_; }

  /// Frame `number`.
  Neighbour frame(std::int64_t number) const;

  /// The frame `steps` after frame `number`, which is there: the drive stores every frame.
  Neighbour neighbour(std::int64_t number, int steps) const;

  /// Why none of its frames can be timed: its timestamps.txt cannot be read, is not as
  /// parse_timestamps asks, or ends before the last picture. Empty if nothing is wrong.
  const std::string& fault() const { return fault_; }

  /// Seconds since the first timestamp (NaN past the last one); without timestamps 0.1 s a frame.
  double time_s(std::int64_t number) const;

  /// timestamps.txt as FrameRef::path writes paths; empty if there is none.
  const std::string& timestamps_path() const { return timestamps_path_; }

 private:
  Neighbour at(const NumberedSequence::Place& place) const;

  std::string pictures_path_;
  std::string timestamps_path_;
  std::string fault_;
  NumberedSequence pictures_;
  std::vector<double> times_s_;
};

}  // namespace eventgan
