#include "pipeline/command_line/recording_arguments.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <map>
#include <string_view>
#include <utility>

#include "manifests/documents/training_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/recording_formats.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/command_line/usage.h"

namespace eventgan {
namespace {

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
  std::map<std::string, RecordingFormat> formats;
  std::vector<std::string_view> with_camera;
  for (const RecordingFormatRow& row : kFrameFormats) {
    formats.emplace(row.word, row.value);
    if (takes(row, "camera")) with_camera.push_back(row.word);
  }
  take_one_of(command.add_option("--format", arguments.format, "Default: detected"), formats);
  command
      .add_option("--camera", arguments.camera,
                  fmt::format("For {}: left (default) or right", fmt::join(with_camera, ", ")))
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
    part.format = arguments.format;
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
