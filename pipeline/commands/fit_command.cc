#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "manifests/documents/sensor_document.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/own_file.h"
#include "manifests/values/faults.h"
#include "pipeline/command_line/options.h"
#include "pipeline/command_line/recording_arguments.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/commands/commands.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/realism/sensor_fit.h"
#include "pipeline/realism/volume_method.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/runtime/threads.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

struct FitArguments {
  RecordingArguments recordings;
  std::vector<int> gaps = {1};
  std::string weights;  ///< none: no network
  std::string name = "camera";
  std::string out;
  int threads = 0;
};

/// The network, or null if there is none or it cannot be told a sensor.
NamedNetwork open_told_network(const std::string& weights) {
  if (weights.empty()) return {};
  NamedNetwork network = open_network(weights);
  if (network.generator->thresholds()) return network;
  tell_note("the weights " + weights + " do not know their sensor: no threshold through them");
  return {};
}

/// What would be a fault of the document, once all is computed.
void check_names(const FitArguments& arguments) {
  CameraSensor named;
  named.name = arguments.name;
  parse_camera_sensor(to_document(named), "--name");
  const std::filesystem::path out = arguments.out;
  if (out.empty()) return;
  if (out.extension() != ".json") {
    throw UsageError("--out: expected a path of *.json, got " + arguments.out);
  }
  if (const auto folder = out.parent_path(); !folder.empty() && !is_directory(folder)) {
    throw InputError("--out: expected a folder, got none, in " + folder.string());
  }
  require_replaceable(out, OwnFile::kSensor);
}

int run_fit(const FitArguments& arguments) {
  check_names(arguments);
  std::vector<std::unique_ptr<Recording>> recordings;
  std::vector<FitPart> parts;
  std::string names;
  const std::vector<RecordingSpec> wanted = wanted_parts(arguments.recordings);
  for (const RecordingSpec& part : wanted) {
    auto recording = open_recording(part.path, part.format, part.options);
    if (wanted.size() > 1 && skipped_as_too_short(part, *recording, arguments.gaps)) continue;
    recordings.push_back(std::move(recording));
    parts.push_back({recordings.back().get(), part.first_frame, part.last_frame});
    names += (names.empty() ? "" : ", ") + std::filesystem::path(part.path).filename().string();
  }
  if (parts.empty()) refuse_all_too_short();
  const NamedNetwork network = open_told_network(arguments.weights);
  const SensorFit fit =
      fit_sensor(parts, network.generator.get(), arguments.gaps, thread_count(arguments.threads));
  for (const auto& recording : recordings) {
    for (const std::string& note : recording->notes()) tell_note(note);
  }
  for (const std::string& warning : fit.warnings) tell_warning(warning);
  const CameraSensor sensor =
      fit.sensor(arguments.name,
                 program_version() + " fit of " + names + ": " +
                     origin_text(fit, std::filesystem::path(arguments.weights).filename()),
                 network.weights_hash);
  const std::string document = to_document(sensor);
  const std::string verdict = verdict_text(
      fit, arguments.out.empty() ? arguments.name + ".json" : arguments.out, arguments.weights);
  std::cout << to_text(fit);
  if (!arguments.out.empty() && !sensor.threshold && !sensor.network && !sensor.noise) {
    std::cout << verdict << std::flush;
    throw InputError("--out: expected recordings that tell a threshold or the noise, got none: " +
                     arguments.out + " is not written");
  }
  if (arguments.out.empty()) {
    std::cout << document;
  } else {
    write_file_atomically(arguments.out, document);
    std::cout << "sensor: " << arguments.out << '\n';
  }
  std::cout << verdict << std::flush;
  return kComplete;
}

}  // namespace

void add_fit_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "fit",
      "Find a camera's thresholds and noise\nFinds out of recordings of one event camera what "
      "convert needs of it: the contrast threshold with which the model difference, and "
      "a network that knows its sensor, make as many events as the camera, and the noise of pixels "
      "that stay still. Writes a sensor's document (manifests/guides/sensor.md).");
  const auto arguments = std::make_shared<FitArguments>();
  add_recording_options(*command, arguments->recordings,
                        "Recordings of events and frames of one camera; a training manifest "
                        "(*.json) stands for its validation recordings");
  add_gaps_option(*command, arguments->gaps);
  command->add_option("--weights", arguments->weights,
                      "Weights that know their sensor, to find their threshold, too: "
                      "FILE.safetensors or shipped:sensor; default: none");
  command->add_option("--name", arguments->name, "Name of the sensor; default: camera");
  command->add_option("--out", arguments->out,
                      "The document to write, *.json, in place of an older one; default: print it");
  add_threads_option(*command, arguments->threads);
  command->callback([arguments, &exit_code] { exit_code = run_fit(*arguments); });
}

}  // namespace eventgan
