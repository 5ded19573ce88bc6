#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "stages/frames/own_labels/detail/image_labels.h"

namespace eventgan {

/// What a sequence's seqinfo.ini says; nothing of what it does not have.
struct MotSequence {
  std::optional<double> frames_per_second;  ///< frameRate, above 0
  std::optional<std::int64_t> length;       ///< seqLength, frames, from 1
  std::optional<ImageSize> size;            ///< imWidth, imHeight
};

/// Reads a seqinfo.ini: section [Sequence] with frameRate, seqLength, imWidth, imHeight, each at
/// most once; other keys are passed over. Throws InputError, "expected X, got Y, in PATH:3". Thread
/// safe.
MotSequence parse_mot_sequence(std::string_view text, const std::string& path);

/// How a gt.txt is to be read, beyond what it says.
struct MotForm {
  int edges_from = 1;                         ///< as LabelSpec::edges_from
  std::vector<std::string> class_names = {};  ///< of class 1, 2, ...; empty: MOT's own
  bool is_visdrone = false;
};

/// Whether a table is VisDrone's (VisDrone2018-MOT-toolkit, README), the last columns of which are
///   ..., score, object_category, truncation, occlusion
/// with whole numbers 0..11, 0..1 and 0..2, where 2D MOT 2015 has coordinates, most often -1.
bool is_visdrone_table(std::string_view text);

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
/// mot_challenge_2d_box.py), a crowd, or VisDrone's ignored regions. track_id is the id. Visibility
/// is the share of the box that is neither hidden nor cut off, and so neither of occlusion and
/// truncation: these stay unknown, and the number is in the original. VisDrone's occlusion is
/// Box's; its truncation 1 is cut by the border, how far is not told.
///
/// CVAT and datumaro write the same table with classes of their own, whose names are in labels.txt
/// beside it, with edges from 0, id -1 for an object without track, and perhaps an empty column at
/// the end. Whole numbers may have decimals ("2.0"). That id, id 0 and conf -1, which is taken for
/// 1, are remarks.
///
/// Result: by frame number, from 1, the frame's lines, byte for byte in the file's order, and its
/// boxes; frames without a line are not in it. A line that is not so, or an id twice in a frame, is
/// a fault of its frame alone: "expected X, got Y, in PATH:3". Throws InputError where a line does
/// not even tell its frame. Thread safe.
std::map<std::int64_t, Outcome<ImageLabels>> parse_mot_labels(std::string_view text,
                                                              const MotForm& form,
                                                              const std::string& path);

}  // namespace eventgan
