#pragma once

#include <filesystem>
#include <memory>

#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// A table of events: .npy with a structured array that has the fields t, x, y and p, or [N, 4]
/// numbers; .npz with arrays of these names; .csv whose header line has them. The names are the
/// options'. There is an element, or a line, for each event, in time order. Columns without names
/// are t, x, y and p of an array [N, 4], and Metavision's x, y, p and t of a .csv whose first line
/// has four numbers, or in the order that their values tell, which a note says; a name in the
/// options that is a number 0..3 is another column. Everything else in the file is passed over.
/// Times count what the options say, else what their column's name ends with, else what the times
/// alone tell (time_unit.h). Where they fall, the events are sorted, which a note says. The
/// sensor's size is the options', or Metavision's line "%geometry". There are no frames.
///
/// A file is read as a whole, first when it is opened; the tables used last are kept. Throws
/// InputError "expected X, got Y, in PATH (line 3)".
std::unique_ptr<Recording> open_table_recording(const std::filesystem::path& path,
                                                const RecordingOptions& options);

}  // namespace eventgan
