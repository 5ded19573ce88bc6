#pragma once

#include <optional>
#include <string>
#include <vector>

#include "manifests/values/training.h"
#include "stages/recordings/readers/recording.h"

namespace CLI {
class App;
}

namespace eventgan {

/// Recordings as commands that compare frames with events take them.
struct RecordingArguments {
  std::vector<std::string> recordings;
  std::optional<RecordingFormat> format;  ///< none: found out
  std::string camera = "left";
  std::string frames;
};

/// Adds the recordings, --format, --camera and --frames; `recordings_text` is the help of the
/// first. `arguments` must outlive the parsing.
void add_recording_options(CLI::App& command, RecordingArguments& arguments,
                           const std::string& recordings_text);

/// Adds --gaps, likewise.
void add_gaps_option(CLI::App& command, std::vector<int>& gaps);

/// The parts of recordings that were meant: each argument is a recording, of which the options say
/// which part, or a training's manifest (*.json), which has its validation's parts. Throws
/// UsageError for options that cannot be, and as read_training_manifest.
std::vector<RecordingSpec> wanted_parts(const RecordingArguments& arguments);

/// Whether a part has too few frames for any of the gaps, which is no error among several
/// recordings: says so then. A part without a frame is not one.
bool skipped_as_too_short(const RecordingSpec& part, const Recording& recording,
                          const std::vector<int>& gaps);

/// Throws UsageError: every part was skipped.
[[noreturn]] void refuse_all_too_short();

}  // namespace eventgan
