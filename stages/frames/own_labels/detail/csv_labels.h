#pragma once

#include <map>
#include <string>
#include <string_view>

#include "manifests/values/faults.h"
#include "stages/frames/own_labels/detail/image_labels.h"

namespace eventgan {

/// A table of boxes (manifests/files/csv_records.h), a row a box, with a header line of the
/// columns
///   image, class, left, top, right, bottom[, track]
/// in any order, each once, also as filename, label, x1 or xmin, ..., with width and height (w and
/// h, bbox_width and bbox_height; beside these width and height are the image's) in place of right
/// and bottom, and between semicolons or tabs. Other columns are passed over, but
/// for a score: that is a detector's. left to bottom are edges in pixels: 0 is the image's left or
/// top edge, so that a whole image is 0,0,WIDTH,HEIGHT. track is a whole number from 0, the same
/// for one object throughout its sequence, or empty. A row with an image alone (`a.png,,,,,`) is an
/// image without boxes, and then the image's only row.
///
/// A row that is there already is left out when the boxes are numbered.
///
/// Result: by image, as the table writes it, its rows (byte for byte, in the file's order), and its
/// boxes. A class that is empty or has control characters, an edge that is no number within 1e6,
/// right < left, bottom < top, a track twice in an image, or a box beside a row without one is a
/// fault of its image alone: "expected X, got Y, in PATH:3". Throws InputError, naming the line,
/// where the header is not so or a row does not even tell its image: other bytes than UTF-8, quotes
/// that do not match, another number of fields, no image; and where edges are shares of the image:
/// all are within 0 and 1.01, and one is no whole number. Thread safe.
std::map<std::string, Outcome<ImageLabels>> parse_csv_labels(std::string_view text,
                                                             const std::string& path);

/// Whether the table's header has a column of scores.
bool has_score_column(std::string_view text);

/// Whether the table's header is one that parse_csv_labels reads.
bool has_box_header(std::string_view text);

/// Whether the table's header has a column of images and a box's four edges, or two and its sides.
bool has_box_columns(std::string_view text);

}  // namespace eventgan
