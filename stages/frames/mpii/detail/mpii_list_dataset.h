#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "manifests/values/labels.h"

namespace eventgan {

/// The two forms in which pose trainers keep MPII's people, one row a person. They differ in names,
/// in how they mark what is missing, and in centre and scale (see parse_mpii_list_row).
enum class MpiiListForm { kJsonList, kTable };

/// Rows as the file has them: every field, as JSON.
struct MpiiList {
  MpiiListForm form = MpiiListForm::kJsonList;
  std::vector<nlohmann::ordered_json> rows;
  std::vector<std::string> notes;
};

/// The field that names the row's image: "image" or "imgname".
const char* image_field(MpiiListForm form);

/// The person of one row. Joints and centre count pixels from 1 in both forms; one is taken from
/// them here, once. Centre and scale are as the file has them; a table's are those of stacked
/// hourglass: the centre is already moved down by 15 scale, the scale already multiplied by 1.25. A
/// joint is missing at (-1, -1) in a list and (0, 0) in a table, a centre at (-1, -1) in both.
/// Joints may be absent (the list of test images). Visibility is what the file says; the usual
/// lists say 1 of every annotated joint, also of a hidden one, where the table says 0. Throws
/// std::invalid_argument("expected .., got .. at joints").
Person parse_mpii_list_row(const nlohmann::ordered_json& row, MpiiListForm form);

/// Reads an HDF5 table of people (valid.h5, train.h5): datasets of equal length side by side, row i
/// of each belonging to person i. Every numeric or text dataset as long as `imgname` becomes a
/// field of the rows, NaN and infinity null; others are named in the notes. `imgname` may be fixed
/// or variable-length text, or an array of character codes padded with zeros. Throws InputError.
/// Thread safe.
MpiiList read_mpii_table(const std::filesystem::path& file);

/// Reads a JSON list of people, or an HDF5 table of them; which of the two it is, its first bytes
/// tell. Throws InputError if it is neither, is damaged, or a row names no image.
MpiiList read_mpii_list(const std::filesystem::path& file);

}  // namespace eventgan
