#pragma once

#include <filesystem>

#include "stages/recordings/detail/stored_recording.h"

namespace eventgan {

/// A recording in AEDAT 4.0, as iniVation's DV and dv-processing write it: one stream of events, at
/// most one of frames; others (IMU, triggers) are passed over. Packets are unpacked one at a time
/// (LZ4, Zstandard or not packed); only where they are stays in memory.
///
/// Times are seconds of Unix time, stored as whole microseconds. A frame's is the middle of its
/// exposure, rounded down, where its begin and end are told, else the frame's own. Frames in colour
/// are made grey (ITU-R BT.601).
///
/// All packets are read once on opening: their events' times, their frames, and whether the file's
/// table of packets says the same of them. A file whose camera was unplugged has no such table; if
/// its last packet is cut off, that is left out, and notes say so. Throws InputError "expected X,
/// got Y, in PATH (byte 4567)" for anything else.
StoredParts open_aedat4(const std::filesystem::path& path);

}  // namespace eventgan
