#pragma once

#include <filesystem>

#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {

/// A recording in AEDAT 4.0, as iniVation's DV, dv-processing and jAER write it: of several streams
/// of events the first or the one that the options name, and a camera's frames; others (IMU,
/// triggers) are passed over. Packets are unpacked one at a time (LZ4, Zstandard or not packed);
/// only where they are stays in memory.
///
/// Times are seconds of Unix time, stored as whole microseconds. A frame's is the middle of its
/// exposure, rounded down, where its begin and end are told, else the frame's own. Frames in colour
/// are made grey (ITU-R BT.601), of 16 bits the upper 8 are taken. Frames that are damaged, not of
/// the events' whole sensor, or no later than the one before are left out, which a note counts.
///
/// Where the file's table tells of packets as they are, a packet of events is read when it is
/// needed, else all on opening. A file whose camera was unplugged or whose writer crashed has no
/// such table; if its last packet is cut off, that is left out, and notes say so. Throws InputError
/// "expected X, got Y, in PATH (byte 4567)" for anything else.
StoredParts open_aedat4(const std::filesystem::path& path, const RecordingOptions& options = {});

}  // namespace eventgan
