#include "pipeline/command_line/recording_arguments.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <utility>

#include "manifests/documents/training_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/words.h"
#include "pipeline/command_line/standard_streams.h"

namespace eventgan {
namespace {

/// As told, else by what is there.
RecordingFormat format_of(const RecordingArguments& arguments, const std::string& recording) {
  for (const auto& [word, format] : kRecordingFormatWords) {
    if (arguments.format == word) return format;
  }
  const bool is_folder = std::filesystem::is_directory(recording);
  RecordingOptions options;
  options.camera = arguments.camera;
  return find_recording_format(recording, options)
      .value_or(is_folder ? RecordingFormat::kEcd : RecordingFormat::kMvsec);
}

std::int64_t frame_in(const std::string& text, const std::string& expected) {
  std::int64_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) throw UsageError(expected + ", got \"" + text + "\"");
  return value;
}

/// "3:8", "3:" or ":8".
void read_frame_range(const std::string& text, RecordingSpec& spec) {
  const std::string expected = "--frames: expected FIRST:LAST";
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) throw UsageError(expected + ", got \"" + text + "\"");
  const std::string first = text.substr(0, colon);
  const std::string last = text.substr(colon + 1);
  if (!first.empty()) spec.first_frame = frame_in(first, expected);
  if (!last.empty()) spec.last_frame = frame_in(last, expected);
}

}  // namespace

void add_recording_options(CLI::App& command, RecordingArguments& arguments,
                           const std::string& recordings_text) {
  command.add_option("RECORDING", arguments.recordings, recordings_text)->required();
  command
      .add_option("--format", arguments.format,
                  "mvsec, eventgan, ecd, aedat4 or dsec; default: detected")
      ->check(CLI::IsMember({"mvsec", "eventgan", "ecd", "aedat4", "dsec"}));
  command.add_option("--camera", arguments.camera, "For mvsec: left (default) or right")
      ->check(CLI::IsMember({"left", "right"}));
  command.add_option("--frames", arguments.frames, "Range of frames, FIRST:LAST; default: all");
}

void add_gaps_option(CLI::App& command, std::vector<int>& gaps) {
  command
      .add_option("--gaps", gaps, "Gaps between the two frames of a pair, such as 1,2; default: 1")
      ->delimiter(',');
}

std::vector<RecordingSpec> wanted_parts(const RecordingArguments& arguments) {
  std::vector<RecordingSpec> parts;
  for (const std::string& argument : arguments.recordings) {
    if (argument.ends_with(".json")) {
      const TrainingManifest manifest = read_training_manifest(argument);
      if (manifest.validation.empty()) {
        throw UsageError("expected a training manifest with validation recordings, got none in " +
                         argument);
      }
      for (RecordingSpec part : manifest.validation) {
        part.path = resolve(manifest, part.path).string();
        parts.push_back(std::move(part));
      }
      continue;
    }
    RecordingSpec& part = parts.emplace_back();
    part.path = argument;
    part.format = format_of(arguments, argument);
    part.options.camera = arguments.camera;
    if (!arguments.frames.empty()) read_frame_range(arguments.frames, part);
  }
  return parts;
}

bool skipped_as_too_short(const RecordingSpec& part, const Recording& recording,
                          const std::vector<int>& gaps) {
  const std::int64_t last = part.last_frame.value_or(recording.frame_count() - 1);
  const bool too_short = last >= part.first_frame && std::ranges::all_of(gaps, [&](int gap) {
                           return last - part.first_frame < gap;
                         });
  if (too_short) {
    tell_note("skipped, since it has too few frames for --gaps: " + recording.name());
  }
  return too_short;
}

void refuse_all_too_short() {
  throw UsageError("--gaps: expected a recording with enough frames, got none");
}

}  // namespace eventgan
