#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/documents/sensor_document.h"
#include "manifests/values/faults.h"
#include "manifests/values/generators.h"
#include "manifests/values/job.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/recording_arguments.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/command_line/usage.h"
#include "pipeline/commands/commands.h"
#include "pipeline/realism/realism.h"
#include "pipeline/runtime/errors.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

struct RealismArguments {
  RecordingArguments recordings;
  std::string threshold = "fit";
  std::string sensor;
  std::string out;
  RealismOptions options;
  ProgressStyle progress = ProgressStyle::kAuto;
  bool json = false;
};

const std::map<std::string, GeneratorKind> kMethods = [] {
  std::map<std::string, GeneratorKind> methods;
  for (const GeneratorKind method : realism_methods()) {
    methods.emplace(to_string(method), method);
  }
  return methods;
}();

double number_in(const std::string& text, const std::string& expected) {
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) throw UsageError(expected + ", got \"" + text + "\"");
  return value;
}

ContrastThreshold middle_of(const ThresholdSpec& spec) {
  return {std::sqrt(spec.range[0] * spec.range[1]), spec.ratio};
}

/// The sensor's thresholds in place of fitted ones.
void take_sensor(const std::string& path_or_name, RealismOptions& options) {
  const CameraSensor sensor = open_camera_sensor(path_or_name);
  if (!sensor.threshold && !sensor.network) {
    throw UsageError("--sensor: expected a sensor with a threshold, got one without, in " +
                     path_or_name);
  }
  if (sensor.threshold) options.threshold = middle_of(*sensor.threshold);
  if (!sensor.network) return;
  options.network_threshold = middle_of(sensor.network->threshold);
  options.network_weights = sensor.network->weights;
}

int run_realism(const RealismArguments& arguments) {
  RealismOptions options = arguments.options;
  if (arguments.threshold != "fit") {
    options.threshold = {number_in(arguments.threshold, "--threshold: expected fit or a number")};
    options.network_threshold = options.threshold;
  }
  if (!arguments.sensor.empty()) take_sensor(arguments.sensor, options);
  const std::vector<RecordingSpec> parts = wanted_parts(arguments.recordings);
  std::vector<RealismReport> reports;
  for (const RecordingSpec& part : parts) {
    options.first_frame = part.first_frame;
    options.last_frame = part.last_frame;
    options.images = arguments.out;
    if (parts.size() > 1 && !arguments.out.empty()) {
      options.images /= std::filesystem::path(part.path).stem();
    }
    const auto recording = open_recording(part.path, part.format, part.options);
    if (parts.size() > 1 && skipped_as_too_short(part, *recording, options.gaps)) continue;
    reports.push_back(measure_realism(*recording, options, [&](std::int64_t total) {
      return show_progress(arguments.progress, total, {"pairs", /*has_bytes=*/false});
    }));
    for (const std::string& note : recording->notes()) tell_note(note);
  }
  if (reports.empty()) refuse_all_too_short();
  std::cout << (arguments.json ? to_json(reports) : to_text(reports)) << std::flush;
  return kComplete;
}

void add_methods(CLI::App& command, RealismArguments& arguments) {
  RealismOptions& options = arguments.options;
  std::vector<std::string_view> words;
  for (const GeneratorKind method : options.methods) words.push_back(to_string(method));
  take_one_of(
      command
          .add_option("--with", options.methods,
                      fmt::format("Methods to compare: {}; default: all", fmt::join(words, ",")))
          ->delimiter(','),
      kMethods)
      ->option_text("METHOD,...");
  command.add_option(
      "--weights", options.weights,
      "Weights of the network: FILE.safetensors, shipped, shipped:WIDTH or shipped:sensor; "
      "default: shipped");
  auto* threshold =
      command.add_option("--threshold", arguments.threshold,
                         "Contrast threshold of difference and esim, 0.01..5; default: fit, the "
                         "one that gives as many events as the camera");
  command
      .add_option("--sensor", arguments.sensor,
                  "Take the thresholds of a sensor, and fit what it has not: " +
                      fmt::format("{}", fmt::join(shipped_sensors(), ", ")) +
                      " or a document of eventgan fit (*.json)")
      ->excludes(threshold);
  command
      .add_option("--log-epsilon", options.log_epsilon,
                  "Epsilon in the log intensity of difference and esim, ln(u/255 + epsilon), "
                  "1e-6..1; default: 0.02")
      ->check(finite_range(1e-6, 1));
  command
      .add_option("--esim-displacement", options.esim_displacement_px,
                  "Largest displacement of esim's random motions, in pixels per frame; default: 5")
      ->check(finite_range(0.1, 100));
  command
      .add_option("--esim-draws", options.esim_draws,
                  "Number of random motions per pair; default: 5")
      ->check(CLI::Range(1, 1000));
}

}  // namespace

void add_realism_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "realism",
      "Compare generated events with a camera's\nCompares the event volumes (voxel grids of "
      "events) of the network and of two sensor models with the events that a camera recorded for "
      "the same frames (manifests/guides/realism.md).");
  const auto arguments = std::make_shared<RealismArguments>();
  add_recording_options(*command, arguments->recordings,
                        "Recordings of events and frames; a training manifest (*.json) stands for "
                        "its validation recordings");
  add_gaps_option(*command, arguments->options.gaps);
  add_methods(*command, *arguments);
  command->add_option("--seed", arguments->options.seed, "Random seed; default: 0");
  add_threads_option(*command, arguments->options.threads);
  command->add_flag("--json", arguments->json, "Print JSON with the scores of each pair");
  command->add_option("--out", arguments->out, "Folder for an image of each pair");
  add_progress_option(*command, arguments->progress);
  command->callback([arguments, &exit_code] { exit_code = run_realism(*arguments); });
}

}  // namespace eventgan
