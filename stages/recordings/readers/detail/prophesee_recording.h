#pragma once

#include <filesystem>

#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {

/// The events of a recording of Prophesee's cameras, without frames: DAT of version 2, or RAW in
/// EVT 2.0, 2.1 or 3.0, little-endian, as docs.prophesee.ai describes them.
///
/// Times are whole microseconds, as seconds. Where the file's counter of 24, 32 or 34 bits wraps (a
/// fall of half its range or more), they go on. Unless `time_shift` is false, those of RAW count
/// from the recording's start as Metavision's readers give them: from its first upper part of a
/// time, of EVT 3.0 from the one before.
///
/// Events before the first that a RAW file gives a time and a place, those beside the sensor, words
/// of reserved types and bytes behind the last whole word are left out and counted in notes;
/// triggers and other words are passed over. If none is left of events, that is an InputError.
///
/// Of EVT 2.1, words may have their halves exchanged: as `endianness` says, else as OpenEB knows it
/// by who made the file. If a fifth or more makes no sense, and in the other order hardly anything,
/// that one counts, with a warning.
///
/// The whole file is read once on opening. Of it, what the words before each 128 KiB have said
/// stays in memory, and the events as long as recent_events() keeps them. Throws InputError
/// "expected X, got Y, in PATH (byte 4567)".
StoredParts open_prophesee(const std::filesystem::path& path, const RecordingOptions& options = {});

}  // namespace eventgan
