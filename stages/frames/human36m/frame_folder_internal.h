#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/frames/dataset.h"
#include "stages/frames/numbered_sequence.h"

namespace eventgan {

/// Human3.6M's videos run at this rate, and its frame numbers count all of their frames from 1.
inline constexpr double kHuman36mFramesPerSecond = 50;

/// The stored frames of one video: where they lie, and which numbers ought to be there.
class FrameFolder {
 public:
  /// `folder` as FrameRef::path writes it. `labelled` are the numbers that have a label, in any
  /// order; a picture may be absent. `prefix` stands before the six digits of a name.
  FrameFolder(std::string folder, std::string prefix, NumberedSequence stored,
              const std::vector<std::int64_t>& labelled);

  FrameRef frame(std::int64_t number) const;

  /// The frame `steps` frames after `number` of those that are stored or labelled, however far
  /// apart their numbers: h36m-fetch keeps a frame when the person has moved. One that is labelled
  /// but not stored is a hole.
  Neighbour neighbour(std::int64_t number, int steps) const;

 private:
  std::string folder_;
  std::string prefix_;
  NumberedSequence stored_;
  std::vector<std::int64_t> numbers_;  ///< stored or labelled; ascending, each once
};

}  // namespace eventgan
