#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "stages/frames/own_labels/detail/image_labels.h"

namespace eventgan {

/// What a sequence's seqinfo.ini says.
struct MotSequence {
  double frames_per_second = 0;  ///< frameRate, above 0
  std::int64_t length = 0;       ///< seqLength, frames, from 1
  ImageSize size;                ///< imWidth, imHeight
};

/// Reads a seqinfo.ini: section [Sequence] with frameRate, seqLength, imWidth, imHeight, each
/// once; other keys are passed over. Throws InputError, "expected X, got Y, in PATH:3". Thread
/// safe.
MotSequence parse_mot_sequence(std::string_view text, const std::string& path);

/// The gt.txt of one sequence as MOTChallenge has them (Milan et al., "MOT16", 2016, table 5), a
/// line a box, in any order:
///   frame, id, bb_left, bb_top, bb_width, bb_height, conf[, class[, visibility]]   MOT16, 17, 20
///   frame, id, bb_left, bb_top, bb_width, bb_height, conf, x, y, z                 2D MOT 2015
/// "All frame numbers, target IDs and bounding boxes are 1-based" (motchallenge.net/instructions),
/// so left = bb_left - 1, top = bb_top - 1, right = left + bb_width, bottom = top + bb_height. A
/// box may reach out of the image: MOT's go on where a person is cut by the border.
///
/// Classes 1 to 13 have MOT's names (pedestrian, person_on_vehicle, car, ...); without the column
/// it is pedestrian. A box is to be ignored if conf is 0, or its class is one of those to which
/// tracks may go without loss (person_on_vehicle, static_person, distractor, reflection: TrackEval,
/// mot_challenge_2d_box.py) or a crowd. track_id is the id. Visibility, 0 to 1, is the share of the
/// box that is neither hidden nor cut off, and so neither of occlusion and truncation: these stay
/// unknown, and the number is in the original.
///
/// Result: by frame number, from 1, the frame's lines, byte for byte in the file's order, and its
/// boxes; frames without a line are not in it. A line that is not so, an id twice in a frame, or a
/// side that is not above 0 is a fault of its frame alone: "expected X, got Y, in PATH:3". Throws
/// InputError where a line does not even tell its frame. Thread safe.
std::map<std::int64_t, Outcome<ImageLabels>> parse_mot_labels(std::string_view text,
                                                              const std::string& path);

}  // namespace eventgan
