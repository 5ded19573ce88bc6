#pragma once

#include <string>
#include <vector>

#include "manifests/values/training.h"

namespace CLI {
class App;
}

namespace eventgan {

/// Recordings as commands that compare frames with events take them.
struct RecordingArguments {
  std::vector<std::string> recordings;
  std::string format;
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

}  // namespace eventgan
