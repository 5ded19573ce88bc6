#pragma once

#include <filesystem>

#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {

/// The events of a recording in AEDAT 3.1, as cAER writes it (docs.inivation.com), of the first
/// source that has some or of the one that `stream` names, and that source's frames; the time of a
/// frame is the middle of its exposure. Packets that are packed (Serial-TS, PNG) are refused.
///
/// Events that are marked invalid, those of other types and a last packet that is cut off are left
/// out and counted in notes. The whole file is read once on opening. Throws InputError "expected X,
/// got Y, in PATH (byte 4567)".
StoredParts open_aedat3(const std::filesystem::path& path, const RecordingOptions& options = {});

}  // namespace eventgan
