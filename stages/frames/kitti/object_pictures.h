#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/frames/numbered_sequence.h"
#include "stages/frames/source_root.h"

namespace eventgan {

/// The pictures of KITTI object itself: image_2 and the three frames before each in prev_2. Listed
/// once; thread-safe.
class ObjectPictures {
 public:
  static constexpr int kPrevious = 3;  ///< prev_2 reaches as far back as this

  /// Throws InputError if there is no image_2; prev_2 may be absent.
  explicit ObjectPictures(const SourceRoot& root);

  const NumberedSequence& labelled() const { return labelled_; }

  /// Files of prev_2 whose names are none of a previous frame, sorted.
  const std::vector<std::string>& previous_left_out() const { return previous_left_out_; }

  /// The picture `steps` (-3..0) after picture `number`, below the root; where it is absent, the
  /// path it would have, given that the picture's name is `stem`. A hole if an earlier frame is
  /// there.
  struct Place {
    Neighbour::State state;
    std::string path;
  };
  Place at(std::int64_t number, const std::string& stem, int steps) const;

 private:
  NumberedSequence labelled_;
  std::array<NumberedSequence, kPrevious> previous_;  ///< by K - 1
  std::vector<std::string> previous_left_out_;
};

}  // namespace eventgan
