#pragma once

#include <filesystem>
#include <optional>

#include "stages/recordings/detail/stored_recording.h"

namespace eventgan {

/// The events of a recording of Prophesee's cameras, without frames: DAT of version 2, or RAW in
/// EVT 2.0 or EVT 3.0, little-endian, as docs.prophesee.ai describes them.
///
/// Times are seconds of the camera's clock, stored as whole microseconds. Where the file's counter
/// of 24, 32 or 34 bits wraps, they go on. Events before the first that a RAW file gives a time and
/// a place are left out and counted in a note; triggers and other words are passed over.
///
/// The whole file is read once on opening. Of it, what the words before each 128 KiB have said
/// stays in memory, and the events as long as RecentEvents keeps them. `sensor` is the size where
/// the header does not tell it. Throws InputError "expected X, got Y, in PATH (byte 4567)".
StoredParts open_prophesee(const std::filesystem::path& path,
                           const std::optional<ImageSize>& sensor);

}  // namespace eventgan
